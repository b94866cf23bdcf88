"""Rectangles of shadow maps that dynamic objects may cover."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_MARGIN_PX = 1.0


def covered_px(
    clips: NDArray[np.float64],
    rectangles_px: NDArray[np.float64],
    centers_m: NDArray[np.float64],
    radii_m: NDArray[np.float64],
    starts: NDArray[np.intp],
) -> NDArray[np.intp]:
    """Non-empty rectangles (n, 4), left, top, width and height, that bound objects in maps.

    Args:
        clips: (maps, 4, 4) clip_from_anchor matrices.
        rectangles_px: (maps, 4) rectangles of the maps in the texture.
        centers_m: (items, 3) centers of bounding spheres, relative to the anchor, by object.
        radii_m: (items,) their radii.
        starts: (objects,) first item of each object.
    """
    rows = clips[:, (0, 1, 3)]  # x, y, w
    middle = np.einsum("mkc,ic->mik", rows[..., :3], centers_m) + rows[:, None, :, 3]
    reach = np.linalg.norm(rows[..., :3], axis=-1)[:, None] * radii_m[:, None]
    nearest, farthest = middle[..., 2] - reach[..., 2], middle[..., 2] + reach[..., 2]
    crosses = nearest <= 1e-6
    depths = np.stack((np.where(crosses, 1.0, nearest), np.where(crosses, 1.0, farthest)))
    low = np.min((middle - reach)[None, ..., :2] / depths[..., None], axis=0)
    high = np.max((middle + reach)[None, ..., :2] / depths[..., None], axis=0)
    low[crosses], high[crosses] = -1.0, 1.0  # the whole map
    behind = farthest <= 0.0
    low[behind], high[behind] = np.inf, -np.inf
    low = np.minimum.reduceat(low, starts, axis=1)
    high = np.maximum.reduceat(high, starts, axis=1)
    corner_px, size_px = rectangles_px[:, None, :2], rectangles_px[:, None, 2:]
    low_px = np.floor(np.clip(0.5 * (low + 1.0), 0.0, 1.0) * size_px - _MARGIN_PX)
    high_px = np.ceil(np.clip(0.5 * (high + 1.0), 0.0, 1.0) * size_px + _MARGIN_PX)
    low_px, high_px = np.maximum(low_px, 0.0), np.minimum(high_px, size_px)
    is_seen = np.all((low < 1.0) & (high > -1.0), axis=-1)
    covered = np.concatenate((corner_px + low_px, high_px - low_px), axis=-1)[is_seen]
    return covered.astype(np.intp)
