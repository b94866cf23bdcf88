"""Heights of upward-facing surfaces: floors, and objects on them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from omnisim.scene.model import Scene
from omnisim.scene.space.triangles import TriangleBvh, Triangles, triangles_within

# Corners are float32 and transformed by matrices: further digits are rounding errors, not slope.
HEIGHT_DIGITS = 5
EDGE = 1e-9  # share of a triangle's area: a point on a shared edge hits at least one triangle


class HeightField:
    """Upward-facing surfaces of a scene between two corners (2,) of its floor plan.

    Glass is included; ceilings, undersides of slabs and other downward-facing surfaces are not.
    """

    def __init__(self, scene: Scene, low_m: NDArray[np.float64], high_m: NDArray[np.float64]):
        triangles = triangles_within(scene, low_m, high_m)
        self._triangles: Triangles = triangles[triangles.seen_from_above]
        self._bvh = TriangleBvh(self._triangles.corners_m)

    def heights_m(self, points_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Heights (n, k, surfaces) at n groups of nearby points (n, k, 2).

        Heights are ascending; −inf pads short rows.
        """
        groups, size = points_m.shape[:2]
        ends = np.full((groups, 1), np.inf)
        low = np.concatenate((points_m.min(axis=1), -ends), axis=1)
        high = np.concatenate((points_m.max(axis=1), ends), axis=1)
        group, triangles = self._bvh.overlaps(low, high)
        heights = _heights_at(self._triangles.corners_m[triangles], points_m[group])
        points = group[:, None] * size + np.arange(size)
        hit = np.isfinite(heights)
        points, heights = points[hit], np.round(heights[hit], HEIGHT_DIGITS) + 0.0  # avoids -0.0
        counts = np.bincount(points, minlength=groups * size)
        order = np.lexsort((heights, points))
        ranks = np.arange(len(points)) - np.repeat(np.cumsum(counts), counts)
        table = np.full((groups * size, max(1, int(counts.max(initial=0)))), -np.inf)
        table[points[order], ranks] = heights[order]
        return table.reshape(groups, size, -1)


def floor_height_m(scene: Scene, point_m: ArrayLike, near_m: float = 0.0) -> float | None:
    """Height of the upward-facing surface at (x, y) nearest to a given height; None: no surface."""
    point = np.asarray(point_m, dtype=np.float64)
    heights = HeightField(scene, point, point).heights_m(point[None, None]).ravel()
    heights = heights[np.isfinite(heights)]
    if not len(heights):
        return None
    return float(heights[np.argmin(np.abs(heights - near_m))])


def _heights_at(
    corners_m: NDArray[np.float64], points_m: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Heights (n, k) of triangles (n, 3, 3) at points (n, k, 2); NaN outside a triangle."""
    a, b, c = corners_m[:, None, 0], corners_m[:, None, 1], corners_m[:, None, 2]
    total = _areas(a - c, b - c)
    with np.errstate(divide="ignore", invalid="ignore"):
        # barycentric coordinates, each from the edge opposite its corner
        of_a = _areas(b[..., :2] - points_m, c[..., :2] - points_m) / total
        of_b = _areas(c[..., :2] - points_m, a[..., :2] - points_m) / total
        of_c = 1.0 - of_a - of_b
        heights = c[..., 2] + of_a * (a - c)[..., 2] + of_b * (b - c)[..., 2]
        inside = (of_a >= -EDGE) & (of_b >= -EDGE) & (of_c >= -EDGE)  # false for NaN as well
    return np.where(inside, heights, np.nan)


def _areas(first_m: NDArray[np.float64], second_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Twice the signed areas (...) spanned by vectors (..., 2 or 3), seen from above."""
    areas: NDArray[np.float64] = (
        first_m[..., 0] * second_m[..., 1] - first_m[..., 1] * second_m[..., 0]
    )
    return areas
