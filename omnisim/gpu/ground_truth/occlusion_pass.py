"""What gets hidden: which points of a picture are behind something from the next viewpoint."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.errors import GraphicsError
from omnisim.gpu.capture.capture_pass import connect_cube
from omnisim.gpu.capture.ray_table import RayTable
from omnisim.gpu.gl_functions import clear_integers, flush
from omnisim.gpu.ground_truth.hit_tables import (
    DrawItemTable,
    connect_places,
    connect_tables,
    use_tables,
)
from omnisim.gpu.ground_truth.ray_hit_pass import RayHitPass
from omnisim.gpu.ground_truth.visibility_pass import VisibilityPass
from omnisim.gpu.shader_files import build_program
from omnisim.gpu.uniforms import columns_first

_RAYS, _HITS_NOW, _SURFACES_NOW = 1, 4, 5  # texture units


class OcclusionPass:
    """Looks the points that rays hit up from another viewpoint; everything is made once.

    Args:
        context: where.
        visibility: which triangles are visible; drawn anew, from the other viewpoint.
        rays: of the pixels.
        now: what the rays hit.

    Raises:
        GraphicsError: no memory for it.
    """

    def __init__(
        self,
        context: moderngl.Context,
        visibility: VisibilityPass,
        rays: RayTable,
        now: RayHitPass,
    ):
        self._visibility = visibility
        self._rays, self._now = rays, now
        program = build_program(context, "capture/picture.vert", "ground_truth/next_view.frag")
        connect_cube(program, visibility.plan, np.eye(3))
        connect_places(program, visibility)
        connect_tables(program, visibility)
        for name, unit in (
            ("u_rays", _RAYS),
            ("u_hits_now", _HITS_NOW),
            ("u_surfaces_now", _SURFACES_NOW),
        ):
            program[name] = unit
        self._rig_from_viewpoint = program["u_rig_from_viewpoint"]
        self._vertex_array = rays.vertex_array(program)
        try:
            hidden = context.renderbuffer(rays.size, 1, dtype="u1")
            self._target = context.framebuffer([hidden])
        except moderngl.Error as reason:
            raise GraphicsError(
                f"flow of {rays.size[0]} × {rays.size[1]} px does not fit on this GPU ({reason}): "
                "make the picture smaller"
            ) from None
        # once: nothing is ever drawn where there is no ray
        self._target.use()
        clear_integers(0)
        draws = visibility.buffers.draw_items
        self._draws = DrawItemTable(context, draws)
        self._object_plus_one = np.array(
            [0 if draw.object_index is None else draw.object_index + 1 for draw in draws],
            dtype=np.intp,
        )

    def render(
        self,
        world_from_rig: NDArray[np.float64],
        world_from_objects: Sequence[NDArray[np.float64]],
        next_from_current: NDArray[np.float64],
    ) -> None:
        """Start to look; `read` has what is found.

        Args:
            world_from_rig: (4, 4) next pose.
            world_from_objects: (4, 4) each, the dynamic objects' next poses.
            next_from_current: (1 + objects, 4, 4), from this viewpoint to the next one, both in the
                axes of the world: of the static scene, then of each dynamic object.
        """
        visibility = self._visibility
        placement = visibility.buffers.instance_transforms(
            world_from_rig[:3, 3], world_from_objects
        )
        visibility.render(world_from_rig, placement)
        self._draws.write(placement, next_from_current[self._object_plus_one, :3])
        self._rig_from_viewpoint.write(columns_first(world_from_rig[:3, :3].T))
        self._target.use()
        use_tables(visibility, self._draws)
        self._rays.rays.use(_RAYS)
        self._now.hits.use(_HITS_NOW)
        self._now.surfaces.use(_SURFACES_NOW)
        if self._vertex_array is not None:
            self._vertex_array.render(moderngl.TRIANGLES)
        flush()

    def read(self) -> NDArray[np.bool_]:
        """Which pixels' (height, width) points are hidden."""
        width, height = self._rays.size
        hidden = np.empty((height, width), dtype=np.bool_)
        self._target.read_into(hidden.view(np.uint8), components=1, dtype="u1")
        return hidden
