"""Views of the tiles from a pose: matrices and frustum planes of the virtual cameras."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.core.cube import FACE_FROM_RIG
from omnisim.rendering.opengl.atlas.tile_plan import Tile, TilePlan

_MIN_LENGTH = 1e-30  # of a normal: an infinitely far plane has a normal of 0


class PosedViews(NamedTuple):
    """Views of all tiles in one frame, in the viewpoint frame.

    Attributes:
        tiles: the tiles.
        clips_from_viewpoint: (tiles, 4, 4) projections from the viewpoint frame to clip space.
        frustum_planes: (tiles, 6, 4), inward unit normals and distances of left, right, top,
            bottom, near and far. A point is inside if n · (x, y, z) + d ≥ 0.
    """

    tiles: tuple[Tile, ...]
    clips_from_viewpoint: NDArray[np.float64]
    frustum_planes: NDArray[np.float64]

    def cull(
        self, centers_m: NDArray[np.float64], radii_m: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        """Mask (tiles, n) of spheres (n, 3) and (n,) that are not outside of a tile's frustum."""
        inside_m = self.frustum_planes[..., :3] @ centers_m.T + self.frustum_planes[..., 3:]
        return np.all(inside_m + radii_m >= 0.0, axis=1)


class TileViews:
    """Projections of all tiles of a plan.

    Args:
        plan: the tiles.
        near_m, far_m: clip planes of the virtual cameras.
    """

    def __init__(self, plan: TilePlan, near_m: float, far_m: float):
        self._tiles = plan.tiles
        self._faces_from_rig = FACE_FROM_RIG[[tile.face for tile in plan.tiles]]
        self._clips_from_face = np.stack([_projection(one, near_m, far_m) for one in plan.tiles])
        self._planes_in_rig = frustum_planes(clips_from_rig(plan, near_m, far_m))

    def at(self, world_from_rig: NDArray[np.float64]) -> PosedViews:
        """Views from a pose (4, 4)."""
        rig_from_viewpoint = world_from_rig[:3, :3].T
        clips, planes = self._clips_from_face.copy(), self._planes_in_rig.copy()
        clips[..., :3] = clips[..., :3] @ (self._faces_from_rig @ rig_from_viewpoint)
        planes[..., :3] = planes[..., :3] @ rig_from_viewpoint
        return PosedViews(self._tiles, clips, planes)


def frustum_planes(clips: NDArray[np.float64]) -> NDArray[np.float64]:
    """Frustum planes (n, 6, 4), see `PosedViews`, of matrices (n, 4, 4) to clip space."""
    x, y, z, w = np.moveaxis(clips, 1, 0)
    planes: NDArray[np.float64] = np.stack((w + x, w - x, w + y, w - y, w - z, z), axis=1)
    lengths = np.linalg.norm(planes[..., :3], axis=-1, keepdims=True)
    planes /= np.maximum(lengths, _MIN_LENGTH)
    return planes


def clips_from_rig(plan: TilePlan, near_m: float, far_m: float) -> NDArray[np.float64]:
    """Matrices (tiles, 4, 4) from rig axes at the viewpoint to each tile's clip space."""
    clips = np.stack([_projection(one, near_m, far_m) for one in plan.tiles])
    clips[..., :3] = clips[..., :3] @ FACE_FROM_RIG[[tile.face for tile in plan.tiles]]
    return clips


def _projection(tile: Tile, near_m: float, far_m: float) -> NDArray[np.float64]:
    """Matrix (4, 4) clip_from_face of a tile; clip-space y points down the image.

    Depth is 1 at the near plane and 0 at the far plane, which may be infinite.
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
