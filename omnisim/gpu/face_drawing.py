"""What all passes over the faces of the cube share: which draws a face sees, and through what."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.cube import FACE_FROM_RIG
from omnisim.gpu.face_plan import Face, FacePlan
from omnisim.gpu.reversed_depth import CLEARED_DEPTH, DEPTH_FUNCTION
from omnisim.gpu.scene_buffers import Placement, SceneBuffers
from omnisim.gpu.uniforms import columns_first

# Draws a draw of an index by its matrix clip_from_mesh (4, 4), columns first.
Paint = Callable[[int, NDArray[np.float32]], None]


class FaceDrawing:
    """Draws what the faces see into their tiles, by whatever program.

    Whatever differs between passes, they do themselves: what is cleared, blending, which program.
    Sides, depth, clipping and culling are the same for all.

    Args:
        context: where.
        buffers: the scene and its movers.
        plan: the faces.
        near_m, far_m: of the virtual cameras.
    """

    def __init__(
        self,
        context: moderngl.Context,
        buffers: SceneBuffers,
        plan: FacePlan,
        near_m: float,
        far_m: float,
    ):
        self._context, self._buffers, self._plan = context, buffers, plan
        self._near_m, self._far_m = near_m, far_m

    def begin(self, target: moderngl.Framebuffer, color: Iterable[float]) -> None:
        """Clear a target and use it, with depth."""
        context = self._context
        target.use()
        target.scissor = None
        target.viewport = (0, 0, *target.size)
        target.depth_mask = True
        target.clear(*color, depth=CLEARED_DEPTH)
        context.enable_only(moderngl.DEPTH_TEST)
        context.depth_func = DEPTH_FUNCTION
        # y of the clip space runs down the picture, so triangles turn the other way round
        context.cull_face = "back"

    def draw(
        self,
        target: moderngl.Framebuffer,
        world_from_rig: NDArray[np.float64],
        placement: Placement,
        order: NDArray[np.intp],
        paint: Paint,
    ) -> None:
        """Draw every face: those draws of `order` that it may see, in that order."""
        for face in self._plan.faces:
            self._draw_face(face, target, world_from_rig, placement, order, paint)

    def end(self, target: moderngl.Framebuffer) -> None:
        """Leave everything as the passes after this one expect it."""
        target.scissor = None
        target.depth_mask = True
        self._context.disable(moderngl.CULL_FACE | moderngl.BLEND | moderngl.DEPTH_TEST)

    def _draw_face(
        self,
        face: Face,
        target: moderngl.Framebuffer,
        world_from_rig: NDArray[np.float64],
        placement: Placement,
        order: NDArray[np.intp],
        paint: Paint,
    ) -> None:
        context, draws = self._context, self._buffers.draws
        face_from_here = np.eye(4)
        face_from_here[:3, :3] = FACE_FROM_RIG[face.index] @ world_from_rig[:3, :3].T
        clip_from_face = projection(face, self._near_m, self._far_m)
        clip_from_mesh = (clip_from_face @ face_from_here) @ placement.here_from_mesh
        clip_matrices = columns_first(clip_from_mesh)
        centres = placement.centres_m @ face_from_here[:3, :3].T
        seen = reaches(face, centres, self._buffers.radii_m, self._near_m, self._far_m)
        tile = (face.left_px, face.top_px, *face.tile_px)
        target.viewport = target.scissor = tile
        for index in order[seen[order]]:
            context.front_face = "ccw" if draws[index].mirrored else "cw"
            toggle = context.disable if draws[index].material.double_sided else context.enable
            toggle(moderngl.CULL_FACE)
            paint(index, clip_matrices[index])


def projection(face: Face, near_m: float, far_m: float) -> NDArray[np.float64]:
    """Matrix (4, 4) clip_from_face of a tile; y of the clip space runs down the picture.

    Its depth runs from 1 at the near plane to 0 at the far one, which may be infinite.
    """
    first, last = face.tangents
    (x_scale, y_scale), (x_shift, y_shift) = 2.0 / (last - first), -(last + first) / (last - first)
    if math.isinf(far_m):
        z_scale, z_shift = 0.0, near_m
    else:
        z_scale = -near_m / (far_m - near_m)
        z_shift = far_m * near_m / (far_m - near_m)
    return np.array(
        [
            [x_scale, 0.0, x_shift, 0.0],
            [0.0, y_scale, y_shift, 0.0],
            [0.0, 0.0, z_scale, z_shift],
            [0.0, 0.0, 1.0, 0.0],
        ]
    )


def reaches(
    face: Face,
    centres: NDArray[np.float64],
    radii: NDArray[np.float64],
    near_m: float,
    far_m: float,
) -> NDArray[np.bool_]:
    """Which spheres (n,), centres (n, 3) in the face's frame, may touch what a tile shows."""
    x, y, z = centres.T
    seen = (z + radii >= near_m) & (z - radii <= far_m)
    for across, first, last in zip((x, y), *face.tangents, strict=True):
        # signed distances to the planes through the viewpoint and the tile's edges
        seen &= (across - first * z) / math.hypot(1.0, first) >= -radii
        seen &= (last * z - across) / math.hypot(1.0, last) >= -radii
    return seen
