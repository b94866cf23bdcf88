"""Draws an environment map behind the geometry in the tiles of an atlas."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.opengl.atlas.tile_plan import TilePlan
from omnisim.rendering.opengl.atlas.tile_views import clips_from_rig
from omnisim.rendering.opengl.gl_state import GlState
from omnisim.rendering.opengl.shader_files import build_program
from omnisim.rendering.opengl.uniforms import columns_first, uniform

_DIRECTIONS_BINDING = 15  # as in shaders/scene/sky.vert
SKY_UNIT = 0


class SkyPass:
    """Draws the sky where nothing opaque is, before blended surfaces.

    Args:
        context: OpenGL context.
        sky: texture of the environment map.
        plan: tiles of the atlas.
        cameras: number of cameras drawn together, one layer each; None: one camera, no layers.
    """

    def __init__(
        self,
        context: moderngl.Context,
        sky: moderngl.Texture,
        plan: TilePlan,
        cameras: int | None = None,
    ):
        self._sky, self._tiles, self._state = sky, plan.tiles, GlState()
        defines = () if cameras is None else ("LAYERED",)
        program = build_program(context, "scene/sky.vert", "scene/sky.frag", defines)
        program["u_sky"] = SKY_UNIT
        name = "u_direction_from_clip" if cameras is None else "u_first_direction"
        self._of_tile = uniform(program, name)
        self._triangle = context.vertex_array(program, [])
        clips = clips_from_rig(plan, 1.0, np.inf)[:, [0, 1, 3], :3]
        self._rig_from_clips = np.linalg.inv(clips).astype(np.float64)
        self._directions = None
        if cameras is not None:
            self._directions = context.buffer(reserve=64 * cameras * len(plan.tiles), dynamic=True)

    def draw(self, target: moderngl.Framebuffer, worlds_from_rigs: NDArray[np.float64]) -> None:
        """Draw from poses (cameras, 4, 4), with the state of `GlState.drawing`; keep the depth."""
        self._sky.use(SKY_UNIT)
        cameras = len(worlds_from_rigs)
        worlds_from_clips = np.einsum(
            "cij,tjk->tcik", worlds_from_rigs[:, :3, :3], self._rig_from_clips
        )
        of_tiles: Sequence[NDArray[np.float32] | NDArray[np.int32]]
        if self._directions is None:
            of_tiles = list(columns_first(worlds_from_clips[:, 0]))
        else:
            padded = np.zeros((len(self._tiles) * cameras, 4, 4))
            padded[:, :3, :3] = worlds_from_clips.reshape(-1, 3, 3)
            self._directions.write(columns_first(padded))
            self._directions.bind_to_storage_buffer(_DIRECTIONS_BINDING)
            of_tiles = list(np.arange(0, len(padded), cameras, dtype=np.int32))
        # at the depth of the sky, which is the target's clear depth
        with self._state.where_clear(), self._state.within_rectangles(target) as aim:
            for tile, value in zip(self._tiles, of_tiles, strict=True):
                aim(tile.left_px, tile.top_px, *tile.size_px)
                self._of_tile.write(value)
                self._triangle.render(moderngl.TRIANGLES, vertices=3, instances=cameras)
