"""What all passes over the faces of the cube share: which draws a face sees, and through what."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.cube import FACE_FROM_RIG
from omnisim.gpu.atlas.tile_plan import Tile, TilePlan
from omnisim.gpu.scene.reversed_depth import CLEARED_DEPTH, DEPTH_FUNCTION
from omnisim.gpu.scene.scene_buffers import InstanceTransforms, SceneBuffers
from omnisim.gpu.uniforms import columns_first
from omnisim.scene.model import Material

_NO_FAR_M = 1e30

# Draws a draw of an index by its matrix clip_from_mesh (4, 4), columns first.
Paint = Callable[[int, NDArray[np.float32]], None]


class TileView(NamedTuple):
    """One face in one frame. "Here" has the world's axes and its origin in the viewpoint.

    Attributes:
        face: the face.
        clip_from_viewpoint: (4, 4).
        planes: (6, 4), unit normals inwards and distances, here, of left, right, top, bottom, near
            and far. What is at (x, y, z) is on the inner side where n · (x, y, z) + d ≥ 0.
    """

    tile: Tile
    clip_from_viewpoint: NDArray[np.float64]
    planes: NDArray[np.float64]


class TileDrawer:
    """Draws what the faces see into their tiles, by whatever program.

    Whatever differs between passes, they do themselves: what is cleared, blending, which program.
    Sides, depth, clipping and culling are the same for all.

    Args:
        context: where.
        buffers: the scene and its dynamic objects.
        plan: the faces.
        near_m, far_m: of the virtual cameras.
    """

    def __init__(
        self,
        context: moderngl.Context,
        buffers: SceneBuffers,
        plan: TilePlan,
        near_m: float,
        far_m: float,
    ):
        self._context, self._buffers, self._plan = context, buffers, plan
        self._faces_from_rig = FACE_FROM_RIG[[tile.face for tile in plan.tiles]]
        self._clips_from_face = np.stack([projection(tile, near_m, far_m) for tile in plan.tiles])
        self._planes_of_faces = np.stack([_planes(tile, near_m, far_m) for tile in plan.tiles])

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

    def views(self, world_from_rig: NDArray[np.float64]) -> list[TileView]:
        """The faces from a pose (4, 4)."""
        viewpoint_from_rig = world_from_rig[:3, :3]
        faces_from_viewpoint = self._faces_from_rig @ viewpoint_from_rig.T
        clips_from_viewpoint = self._clips_from_face.copy()
        clips_from_viewpoint[..., :3] = self._clips_from_face[..., :3] @ faces_from_viewpoint
        planes = self._planes_of_faces.copy()
        planes[..., :3] = self._planes_of_faces[..., :3] @ faces_from_viewpoint
        faces = self._plan.tiles
        return [TileView(*one) for one in zip(faces, clips_from_viewpoint, planes, strict=True)]

    def aim(self, target: moderngl.Framebuffer, view: TileView) -> None:
        """DrawItem into a face's tile from now on."""
        tile = view.tile
        target.viewport = target.scissor = (tile.left_px, tile.top_px, *tile.size_px)

    def draw(
        self, view: TileView, placement: InstanceTransforms, order: NDArray[np.intp], paint: Paint
    ) -> None:
        """DrawItem those draws of `order` (n,) that a face may see, in that order."""
        if not order.size:
            return
        order = order[self.sees(view, placement, order)]
        clip_matrices = columns_first(
            view.clip_from_viewpoint @ placement.viewpoint_from_mesh[order]
        )
        for index, clip_from_mesh in zip(order, clip_matrices, strict=True):
            draw = self._buffers.draw_items[index]
            self._context.front_face = "ccw" if draw.flips_winding else "cw"
            self.cull(draw.material)
            paint(index, clip_from_mesh)

    def sees(
        self, view: TileView, placement: InstanceTransforms, draws: NDArray[np.intp]
    ) -> NDArray[np.bool_]:
        """Which of some draws (n,) a face may see."""
        inside_m = placement.centres_m[draws] @ view.planes[:, :3].T + view.planes[:, 3]
        seen: NDArray[np.bool_] = np.all(inside_m.T + self._buffers.radii_m[draws] >= 0.0, axis=0)
        return seen

    def cull(self, material: Material) -> None:
        """DrawItem one side or both, as a material asks for."""
        toggle = self._context.disable if material.double_sided else self._context.enable
        toggle(moderngl.CULL_FACE)

    def end(self, target: moderngl.Framebuffer) -> None:
        """Leave everything as the passes after this one expect it."""
        target.scissor = None
        target.depth_mask = True
        self._context.disable(moderngl.CULL_FACE | moderngl.BLEND | moderngl.DEPTH_TEST)


def projection(tile: Tile, near_m: float, far_m: float) -> NDArray[np.float64]:
    """Matrix (4, 4) clip_from_face of a tile; y of the clip space runs down the picture.

    Its depth runs from 1 at the near plane to 0 at the far one, which may be infinite.
    """
    first, last = tile.padded_region
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


def _planes(tile: Tile, near_m: float, far_m: float) -> NDArray[np.float64]:
    """The planes (6, 4) around what a tile shows, in the face's frame, see `TileView`."""
    (left, top), (right, bottom) = tile.padded_region
    planes = np.array(
        [
            [1.0, 0.0, -left, 0.0],
            [-1.0, 0.0, right, 0.0],
            [0.0, 1.0, -top, 0.0],
            [0.0, -1.0, bottom, 0.0],
            [0.0, 0.0, 1.0, -near_m],
            [0.0, 0.0, -1.0, min(far_m, _NO_FAR_M)],
        ]
    )
    planes[:, :3] /= np.linalg.norm(planes[:, :3], axis=1, keepdims=True)
    return planes
