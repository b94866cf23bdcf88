"""Draws an environment map behind all that the tiles of an atlas show."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.gpu.atlas.tile_plan import TilePlan
from omnisim.gpu.atlas.tile_views import clips_from_rig
from omnisim.gpu.gl_state import GlState
from omnisim.gpu.shader_files import build_program
from omnisim.gpu.uniforms import columns_first, uniform

_RIGS_BINDING = 15  # as in shaders/scene/sky.vert
SKY_UNIT = 0


class SkyPass:
    """Draws the sky where nothing opaque is, before all that is blended.

    Args:
        context: where.
        sky: texture of the environment map.
        plan: the tiles.
        cameras: that are drawn together, each into a layer of the target; None: there is one, and
            no layers.
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
        self._direction_from_clip = uniform(program, "u_direction_from_clip")
        self._triangle = context.vertex_array(program, [])
        clips = clips_from_rig(plan, 1.0, np.inf)[:, [0, 1, 3], :3]
        self._rig_from_clips = np.linalg.inv(clips).astype(np.float64)
        self._rigs = None if cameras is None else context.buffer(reserve=64 * cameras)

    def draw(self, target: moderngl.Framebuffer, worlds_from_rigs: NDArray[np.float64]) -> None:
        """Draw from poses (cameras, 4, 4), with the state of `GlState.drawing`; depth stays as it
        is."""  # fmt: skip
        self._sky.use(SKY_UNIT)
        matrices: NDArray[np.float64] = self._rig_from_clips
        if self._rigs is None:
            matrices = np.einsum("ij,njk->nik", worlds_from_rigs[0, :3, :3], matrices)
        else:
            self._rigs.write(columns_first(worlds_from_rigs))
            self._rigs.bind_to_storage_buffer(_RIGS_BINDING)
        # as deep as the sky is, and the target where it is clear
        with self._state.where_clear(), self._state.within_rectangles(target) as aim:
            for tile, matrix in zip(self._tiles, columns_first(matrices), strict=True):
                aim(tile.left_px, tile.top_px, *tile.size_px)
                self._direction_from_clip.write(matrix)
                self._triangle.render(
                    moderngl.TRIANGLES, vertices=3, instances=len(worlds_from_rigs)
                )
