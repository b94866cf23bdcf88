"""Draws the visible clusters of all views with one call per batch of buckets."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import groupby, product
from typing import NamedTuple

import moderngl
import numpy as np

from omnisim.core.array_types import Indices
from omnisim.rendering.opengl.culling.cluster_culling import BANDS, ClusterCuller, CommandRange
from omnisim.rendering.opengl.drawing.item_uniforms import map_units
from omnisim.rendering.opengl.geometry.clustered_geometry import Bucket, ClusteredGeometry
from omnisim.rendering.opengl.geometry.vertex_format import PALETTE_UNIT, cluster_vertex_array
from omnisim.rendering.opengl.gl.functions import IndirectDraws, constant_call
from omnisim.rendering.opengl.gl.state import GlState


class BucketProgram(NamedTuple):
    """Program that draws a bucket."""

    program: moderngl.Program  # program for vertices of type `CLUSTER_VERTEX`
    # sampler of its textures; None: the textures' own settings
    sampler: moderngl.Sampler | None = None
    # uniform for the index of the first command; None: not used
    first_command: moderngl.Uniform | None = None


class DrawState(NamedTuple):
    """State of a draw call."""

    shader: BucketProgram  # program shared by all of its buckets
    shows_back: bool  # draw back faces, too
    textures: tuple[tuple[int, int], ...]  # names of the textures that the program reads, by unit


class DrawBatches:
    """Batches of a geometry's buckets: consecutive buckets with equal state.

    Args:
        find_program: function from a bucket to its program.
        both_sides: draw back faces, too.

    Attributes:
        states: state of each batch.
        groups: (batches,) number of cluster groups.
    """

    def __init__(
        self,
        geometry: ClusteredGeometry,
        find_program: Callable[[Bucket], BucketProgram],
        both_sides: bool,
    ):
        palette = geometry.palette.glo
        states = [_state(one, find_program(one), both_sides, palette) for one in geometry.buckets]
        runs = [(state, len(list(run))) for state, run in groupby(states)]
        self.states = [state for state, _ in runs]
        ends = np.cumsum([length for _, length in runs])
        groups = np.concatenate(([0], np.cumsum(geometry.buffers.groups_of_bucket)[ends - 1]))
        self.groups: Indices = np.diff(groups)


def _state(bucket: Bucket, shader: BucketProgram, both_sides: bool, palette: int) -> DrawState:
    units = [(0, "u_textures"), *map_units()]
    arrays = zip(units, (bucket.array, *(bucket.maps or ())), strict=False)
    textures = [(*unit, array.array.glo) for unit, array in arrays if array is not None]
    textures.append((PALETTE_UNIT, "u_palette", palette))
    return DrawState(
        shader,
        bucket.double_sided or both_sides,
        tuple((unit, texture) for unit, name, texture in textures if name in shader.program),
    )


class ClusterDrawer:
    """Draws visible clusters with the programs of one pass.

    Args:
        batches: states of the batches.

    Attributes:
        culler: see the arguments.
    """

    def __init__(
        self,
        context: moderngl.Context,
        geometry: ClusteredGeometry,
        culler: ClusterCuller,
        batches: DrawBatches,
    ):
        self.culler, self._states = culler, batches.states
        self._draws = IndirectDraws()
        self._array = cluster_vertex_array(
            context,
            batches.states[0].shader.program,
            geometry.vertices,
            geometry.indices,
            culler.instances,
            geometry.normals,
            geometry.light_coordinates,
        )
        # equal in all frames
        self._calls: list[list[list[Callable[[], object]]]] = []
        set_state = _StateCalls()
        for pass_index in range(culler.passes):
            self._calls.append(
                [self._calls_of(pass_index, ranges, set_state) for ranges in culler.slices]
            )

    def draw(self, pass_index: int) -> None:
        """Draw the commands of a pass, with the state of `GlState.drawing`.

        All previous passes of the frame must have been drawn, and nothing else since.
        """
        if pass_index == 0:
            self._draws.bind(self.culler.commands.glo, self.culler.counts.glo, self._array.glo)
        for number, calls in enumerate(self._calls[pass_index]):
            if number:
                self.culler.next_slice(pass_index, number)
            for call in calls:
                call()

    def _calls_of(
        self, pass_index: int, ranges: Sequence[CommandRange], set_state: _StateCalls
    ) -> list[Callable[[], object]]:
        """Calls that draw a slice, band by band."""
        calls: list[Callable[[], object]] = []
        set_state.forget_program()  # the culling program is still bound
        for band, commands in product(range(BANDS), ranges):
            state, first = self._states[commands.batch], commands.first + band * commands.max_count
            calls += set_state.to(state)
            if state.shader.first_command is not None:
                calls.append(partial(setattr, state.shader.first_command, "value", first))
            count = (BANDS * pass_index + band) * self.culler.ranges + commands.number
            calls.append(self._draws.drawing(first, count, commands.max_count))
        return calls


class _StateCalls:
    """Calls that change only the state that differs from the previous draw's."""

    def __init__(self) -> None:
        self._gl, self._draws = GlState(), IndirectDraws()
        self._program: moderngl.Program | None = None
        self._sampler: moderngl.Sampler | None = None
        self._shows_back = False
        self._textures: dict[int, int] = {}

    def forget_program(self) -> None:
        """Bind the next program in any case."""
        self._program = None

    def to(self, state: DrawState) -> Iterator[Callable[[], object]]:
        """Calls that change the previous state to `state`."""
        shader = state.shader
        if shader.program is not self._program:
            self._program = shader.program
            yield constant_call(self._draws.use_program, shader.program.glo)
        if state.shows_back is not self._shows_back:
            self._shows_back = state.shows_back
            yield partial(self._gl.set_culling, not state.shows_back)
        for unit, texture in state.textures:
            if self._textures.get(unit) != texture:
                self._textures[unit] = texture
                yield constant_call(self._gl.bind_texture, unit, texture)
        if shader.sampler is not None and shader.sampler is not self._sampler:
            self._sampler = shader.sampler
            yield partial(shader.sampler.use, 0)
