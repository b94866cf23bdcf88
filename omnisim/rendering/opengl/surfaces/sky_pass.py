"""Draws an environment map behind the geometry in the tiles of an atlas."""

from __future__ import annotations

import moderngl
import numpy as np

from omnisim.core.arrays import Floats
from omnisim.rendering.atlas.tile_plan import TilePlan, clips_from_rig
from omnisim.rendering.opengl.gl.buffers import written_buffer
from omnisim.rendering.opengl.gl.shader_files import build_program
from omnisim.rendering.opengl.gl.state import GlState

SKY_UNIT = 0
_INSTANCE = np.dtype(  # inputs of shaders/scene/sky.vert
    [("direction_from_corner", "<f4", (3, 3)), ("scale", "<f4", 2), ("shift", "<f4", 2)]
)


class SkyPass:
    """Draws the sky where nothing opaque is; `cameras`: layers drawn together; None: no layers."""

    def __init__(
        self,
        context: moderngl.Context,
        sky: moderngl.Texture,
        plan: TilePlan,
        cameras: int | None = None,
    ):
        self._sky, self._state = sky, GlState()
        defines = () if cameras is None else ("LAYERED",)
        program = build_program(context, "scene/sky.vert", "scene/sky.frag", defines)
        program["u_sky"] = SKY_UNIT
        if cameras is not None:
            program["u_tiles"] = len(plan.tiles)
        self._cameras = cameras or 1
        self.use_plan(plan)
        self._buffer = written_buffer(context, self._instances)
        inputs = "in_direction_from_corner", "in_placement"
        self._tiles = context.vertex_array(program, [(self._buffer, "9f 4f/i", *inputs)])

    def use_plan(self, plan: TilePlan) -> None:
        """Draw other tiles, at most as many as at first, in an atlas of the same size."""
        clips = clips_from_rig(plan, 1.0, np.inf)[:, [0, 1, 3], :3]
        self._rig_from_corners = np.linalg.inv(clips).astype(np.float64)
        self._instances = np.zeros((self._cameras, len(plan.tiles)), dtype=_INSTANCE)
        atlas_px = np.array([plan.width_px, plan.height_px])
        scale = plan.rectangles_px[:, 2:] / atlas_px
        self._instances["scale"] = scale
        self._instances["shift"] = 2.0 * plan.rectangles_px[:, :2] / atlas_px + scale - 1.0

    def draw(self, worlds_from_rigs: Floats) -> None:
        """Draw from poses (cameras, 4, 4), with the state of `GlState.drawing`; keep the depth."""
        instances = self._instances[: len(worlds_from_rigs)]
        directions = worlds_from_rigs[:, None, :3, :3] @ self._rig_from_corners
        instances["direction_from_corner"] = np.swapaxes(directions, -1, -2)  # column-major
        self._buffer.write(instances)
        self._state.bind_texture(SKY_UNIT, self._sky.glo)
        # at the depth of the sky, which is the target's clear depth
        with self._state.where_clear():
            self._tiles.render(moderngl.TRIANGLE_STRIP, vertices=4, instances=instances.size)
