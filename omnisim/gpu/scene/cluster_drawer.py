"""Draws the visible clusters of all views: one call for each bucket, whatever the scene."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from itertools import product
from typing import NamedTuple

import moderngl

from omnisim.gpu.culling.cluster_culling import ClusterCuller
from omnisim.gpu.culling.command_slices import BANDS, CommandRange
from omnisim.gpu.gl_functions import IndirectDraws
from omnisim.gpu.scene.clustered_geometry import ClusteredGeometry
from omnisim.gpu.scene.texture_array import bind_maps
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


class ClusterDrawer:
    """Draws what a culler left, by the programs of one pass.

    Args:
        context: where.
        geometry: the clusters.
        culler: of their views.
        programs: of each bucket.
        both_sides: draw back faces, too.

    Attributes:
        culler: as given.
    """

    def __init__(
        self,
        context: moderngl.Context,
        geometry: ClusteredGeometry,
        culler: ClusterCuller,
        programs: Sequence[BucketProgram],
        both_sides: bool = False,
    ):
        self._context, self.culler = context, culler
        self._draws = IndirectDraws()
        arrays = {
            id(one.program): cluster_vertex_array(
                context,
                one.program,
                geometry.vertices,
                geometry.indices,
                culler.instances,
                geometry.light_coordinates,
            )
            for one in programs
        }
        self._buckets = [
            (one, arrays[id(one.program)], bucket.double_sided or both_sides, bucket)
            for bucket, one in zip(geometry.buckets, programs, strict=True)
        ]
        # the same in each frame
        self._calls = [
            [self._calls_of(pass_index, ranges) for ranges in culler.slices]
            for pass_index in range(culler.passes)
        ]

    def draw(self, pass_index: int) -> None:
        """Draw the commands of a pass; target, depth, viewport and clip distances are set."""
        self._context.front_face = "cw"
        self._draws.bind(self.culler.commands.glo, self.culler.counts.glo)
        for number, calls in enumerate(self._calls[pass_index]):
            if number:
                self.culler.next_slice(pass_index, number)
            for call in calls:
                call()

    def _calls_of(
        self, pass_index: int, ranges: Sequence[CommandRange]
    ) -> list[Callable[[], object]]:
        """Calls that draw a slice, band by band."""
        context, draws = self._context, self._draws
        calls: list[Callable[[], object]] = []
        program = array = double_sided = None
        for band, commands in product(range(BANDS), ranges):
            one, vertices, shows_back, bucket = self._buckets[commands.bucket]
            textures, first = bucket.array, commands.first + band * commands.most
            if one.program is not program:
                program = one.program
                calls.append(partial(draws.use_program, program.glo))
                calls.append(partial(draws.bind_vertex_array, vertices.glo))
            if shows_back is not double_sided:
                double_sided = shows_back
                toggle = context.disable if shows_back else context.enable
                calls.append(partial(toggle, moderngl.CULL_FACE))
            if textures is not None and textures is not array:
                array = textures
                calls.append(partial(draws.bind_texture, 0, array.array.glo))
            if bucket.maps is not None:
                calls.append(partial(bind_maps, bucket.maps))
            if one.sampler is not None:
                calls.append(partial(one.sampler.use, 0))
            if one.first_command is not None:
                calls.append(partial(setattr, one.first_command, "value", first))
            count = (BANDS * pass_index + band) * self.culler.ranges + commands.number
            calls.append(draws.drawing(first, count, commands.most))
        return calls
