"""Draws the visible clusters of all views: one call for each batch of buckets."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from itertools import groupby, product
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.gpu.culling.cluster_culling import ClusterCuller
from omnisim.gpu.culling.command_slices import BANDS, CommandRange
from omnisim.gpu.gl_functions import IndirectDraws
from omnisim.gpu.scene.clustered_geometry import Bucket, ClusteredGeometry
from omnisim.gpu.scene.material_units import map_units
from omnisim.gpu.scene.vertex_format import cluster_vertex_array


class BucketProgram(NamedTuple):
    """Program that draws a bucket.

    Attributes:
        program: of `CLUSTER_VERTEX`.
        sampler: of its textures; None: their own.
        first_command: uniform that is told which command is the first; None: it does not matter.
    """

    program: moderngl.Program
    sampler: moderngl.Sampler | None = None
    first_command: moderngl.Uniform | None = None


class DrawState(NamedTuple):
    """State of a draw call.

    Attributes:
        shader: program of all of its buckets.
        shows_back: back faces are drawn, too.
        textures: names of those that the program reads, by unit.
    """

    shader: BucketProgram
    shows_back: bool
    textures: tuple[tuple[int, int], ...]


class DrawBatches:
    """Batches of a geometry's buckets: those that follow each other and have one state.

    Args:
        geometry: the clusters.
        find_program: of a bucket.
        both_sides: draw back faces, too.

    Attributes:
        states: of the batches.
        groups: (batches,) their numbers of cluster groups.
    """

    def __init__(
        self,
        geometry: ClusteredGeometry,
        find_program: Callable[[Bucket], BucketProgram],
        both_sides: bool,
    ):
        states = [_state(one, find_program(one), both_sides) for one in geometry.buckets]
        runs = [(state, len(list(run))) for state, run in groupby(states)]
        self.states = [state for state, _ in runs]
        ends = np.cumsum([length for _, length in runs])
        groups = np.concatenate(([0], np.cumsum(geometry.buffers.groups_of_bucket)[ends - 1]))
        self.groups: NDArray[np.intp] = np.diff(groups)


def _state(bucket: Bucket, shader: BucketProgram, both_sides: bool) -> DrawState:
    arrays = [(0, "u_textures", bucket.array)]
    arrays += [(*one, array) for one, array in zip(map_units(), bucket.maps or (), strict=False)]
    return DrawState(
        shader,
        bucket.double_sided or both_sides,
        tuple(
            (unit, array.array.glo)
            for unit, name, array in arrays
            if array is not None and name in shader.program
        ),
    )


class ClusterDrawer:
    """Draws what a culler left, by the programs of one pass.

    Args:
        context: where.
        geometry: the clusters.
        culler: of their views, by these batches.
        batches: their states.

    Attributes:
        culler: as given.
    """

    def __init__(
        self,
        context: moderngl.Context,
        geometry: ClusteredGeometry,
        culler: ClusterCuller,
        batches: DrawBatches,
    ):
        self._context, self.culler, self._states = context, culler, batches.states
        self._draws = IndirectDraws()
        self._array = cluster_vertex_array(
            context,
            batches.states[0].shader.program,
            geometry.vertices,
            geometry.indices,
            culler.instances,
            geometry.light_coordinates,
        )
        # the same in each frame
        self._calls = [
            [self._calls_of(pass_index, ranges) for ranges in culler.slices]
            for pass_index in range(culler.passes)
        ]

    def draw(self, pass_index: int) -> None:
        """Draw the commands of a pass; target, depth, viewport and clip distances are set."""
        self._context.front_face = "cw"
        self._draws.bind(self.culler.commands.glo, self.culler.counts.glo)
        self._draws.bind_vertex_array(self._array.glo)
        for number, calls in enumerate(self._calls[pass_index]):
            if number:
                self.culler.next_slice(pass_index, number)
            for call in calls:
                call()

    def _calls_of(
        self, pass_index: int, ranges: Sequence[CommandRange]
    ) -> list[Callable[[], object]]:
        """Calls that draw a slice, band by band; state that stays is not set again."""
        context, draws = self._context, self._draws
        calls: list[Callable[[], object]] = []
        program = sampler = shows_back = None
        bound: dict[int, int] = {}
        for band, commands in product(range(BANDS), ranges):
            state, first = self._states[commands.batch], commands.first + band * commands.most
            shader = state.shader
            if shader.program is not program:
                program = shader.program
                calls.append(partial(draws.use_program, program.glo))
            if state.shows_back is not shows_back:
                shows_back = state.shows_back
                toggle = context.disable if shows_back else context.enable
                calls.append(partial(toggle, moderngl.CULL_FACE))
            for unit, texture in state.textures:
                if bound.get(unit) != texture:
                    bound[unit] = texture
                    calls.append(partial(draws.bind_texture, unit, texture))
            if shader.sampler is not None and shader.sampler is not sampler:
                sampler = shader.sampler
                calls.append(partial(sampler.use, 0))
            if shader.first_command is not None:
                calls.append(partial(setattr, shader.first_command, "value", first))
            count = (BANDS * pass_index + band) * self.culler.ranges + commands.number
            calls.append(draws.drawing(first, count, commands.most))
        return calls
