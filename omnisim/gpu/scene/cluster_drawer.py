"""Draws the visible clusters of all views: one call for each bucket, whatever the scene."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import moderngl

from omnisim.gpu.culling.cluster_culling import ClusterCuller
from omnisim.gpu.culling.command_slices import BANDS
from omnisim.gpu.gl_functions import IndirectDraws, bind_texture
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

    def draw(self, pass_index: int) -> None:
        """Draw the commands of a pass; target, depth, viewport and clip distances are set."""
        self._context.front_face = "cw"
        self._draws.bind(self.culler.commands.glo, self.culler.counts.glo)
        for number in range(len(self.culler.slices)):
            if number:
                self.culler.next_slice(pass_index, number)
            self._draw_slice(pass_index, number)

    def _draw_slice(self, pass_index: int, slice_index: int) -> None:
        context, draws, culler = self._context, self._draws, self.culler
        program = array = double_sided = None
        for band in range(BANDS):
            first_count = (BANDS * pass_index + band) * culler.ranges
            for commands in culler.slices[slice_index]:
                one, vertices, shows_back, bucket = self._buckets[commands.bucket]
                textures, first = bucket.array, commands.first + band * commands.most
                if one.program is not program:
                    program = one.program
                    draws.use_program(program.glo)
                    draws.bind_vertex_array(vertices.glo)
                if shows_back is not double_sided:
                    double_sided = shows_back
                    (context.disable if shows_back else context.enable)(moderngl.CULL_FACE)
                if textures is not None and textures is not array:
                    array = textures
                    bind_texture(0, array.array.glo)
                if bucket.maps is not None:
                    bind_maps(bucket.maps)
                if one.sampler is not None:
                    one.sampler.use(0)
                if one.first_command is not None:
                    one.first_command.value = first
                draws.draw(first, first_count + commands.number, commands.most)
