"""Atlases of many cameras rendered in one submission, one texture array layer each."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.opengl.atlas.tile_plan import TilePlan
from omnisim.rendering.opengl.drawing.cluster_drawer import BlendedDrawer, BucketProgram, arrays_of
from omnisim.rendering.opengl.drawing.sky_pass import SkyPass
from omnisim.rendering.opengl.drawing.surface_program import (
    SurfacePrograms,
    SurfaceVariant,
    variant_of_blended,
    variant_of_bucket,
)
from omnisim.rendering.opengl.drawing.tile_renderer import TileRenderer, VirtualCameras
from omnisim.rendering.opengl.geometry.clustered_geometry import Bucket
from omnisim.rendering.opengl.geometry.draw_item import DrawItem
from omnisim.rendering.opengl.geometry.scene_buffers import SceneBuffers
from omnisim.rendering.opengl.gl.buffers import written_buffer
from omnisim.rendering.opengl.gl.framebuffers import layered_target
from omnisim.rendering.opengl.gl.state import GlState

EXTENSIONS = {"GL_ARB_shader_draw_parameters", "GL_ARB_shader_viewport_layer_array"}
_POSITIONS = 15  # binding, as in `scene/lighting.glsl`


class CubeLayers:
    """Culls and draws clusters and blended items for many cameras together.

    A layer has the viewport and matrices of a single atlas, and therefore the same bytes.

    Args:
        buffers: scene and dynamic objects.
        programs: surface programs for the scene's lights.
        plan: tiles per camera.
        cameras: virtual cameras.
        blended: items that the GPU sorts, see `blended_drawer.can_sort`; may be empty.
        atlases: texture array with one atlas layer per camera.

    Attributes:
        atlases: see the arguments.
    """

    def __init__(
        self,
        buffers: SceneBuffers,
        programs: SurfacePrograms,
        plan: TilePlan,
        cameras: VirtualCameras,
        blended: Sequence[DrawItem],
        atlases: moderngl.TextureArray,
    ):
        self.atlases, self._background = atlases, cameras.background
        self._is_unlit = cameras.unlit
        self._buffers, self._state = buffers, GlState()
        self._target, self._depth = layered_target(buffers.context, atlases)

        def layered(variant: SurfaceVariant) -> moderngl.Program:
            return programs[variant._replace(layered=True)].program

        def find_program(bucket: Bucket) -> BucketProgram:
            return BucketProgram(layered(variant_of_bucket(bucket, cameras.unlit)))

        nothing, count = np.empty(0, dtype=np.intp), atlases.layers
        self._tiles = TileRenderer(
            buffers, plan, cameras, nothing, find_program, self._depth,
            max_cameras=count, blended_items=len(blended),
        )  # fmt: skip
        self._blended: BlendedDrawer | None = None
        geometry, culler = buffers.clustered_geometry, self._tiles.culler
        if blended and geometry is not None and culler is not None:
            variant = variant_of_blended(len(arrays_of(blended)), cameras.unlit, blended)
            program = layered(variant)
            self._blended = BlendedDrawer(buffers.context, geometry, culler, blended, program)
        self._surface_programs, positions = programs, len(programs.positions_m)
        self._positions = written_buffer(buffers.context, 16 * count * positions)
        sky = programs.sky_seen(cameras.unlit)
        self._sky = None if sky is None else SkyPass(buffers.context, sky, plan, count)

    def draw(
        self, poses: Sequence[tuple[NDArray[np.float64], Sequence[NDArray[np.float64]]]]
    ) -> None:
        """Draw from poses of rigs and dynamic objects that all share the shadow maps."""
        rigs = np.array([rig for rig, _ in poses])
        objects = np.array([objects for _, objects in poses])
        positions_m = self._surface_programs.positions_m
        shadows = None if self._is_unlit else self._surface_programs.shadows
        if len(positions_m):
            positions = np.zeros((len(poses), len(positions_m), 4), dtype=np.float32)
            positions[..., :3] = positions_m - rigs[:, None, :3, 3]
            self._positions.write(positions)
        if shadows is not None:
            self._buffers.deform(poses[0][1])  # objects outside of the view cast shadows, too
            shadows.prepare(poses[0][0][:3, 3], poses[0][1])
        self._tiles.begin(self._target, [(*self._background, 1.0)])
        self._surface_programs.bind_tables()
        self._positions.bind_to_storage_buffer(_POSITIONS)
        with self._state.drawing():
            self._tiles.draw_clusters(self._target, rigs, objects)
            if self._sky is not None:
                self._sky.draw(rigs)
            if self._blended is not None:
                with self._state.blending():
                    self._blended.draw()
