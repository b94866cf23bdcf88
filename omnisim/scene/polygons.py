"""Triangulation of planar polygons with holes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from mapbox_earcut import triangulate_float64
from numpy.typing import ArrayLike, NDArray


def triangulate(loops: Sequence[ArrayLike]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Triangulate closed loops by the even-odd rule.

    Args:
        loops: points (n, 2) of each loop, in either direction. The first point is not repeated at
            the end, and loops do not cross.

    Returns:
        Points (p, 2) of all loops, concatenated, and counter-clockwise triangles (m, 3).
    """
    rings = [np.asarray(loop, dtype=np.float64).reshape(-1, 2) for loop in loops]
    points = np.concatenate(rings) if rings else np.zeros((0, 2))
    indices = np.split(np.arange(len(points)), np.cumsum([len(ring) for ring in rings])[:-1])
    depths = [sum(surrounds(other, ring[0]) for other in rings if other is not ring)
              for ring in rings]  # fmt: skip
    triangles = [np.zeros((0, 3), np.int64)]
    for outline, ring in enumerate(rings):
        if depths[outline] % 2:
            continue
        holes = [
            k
            for k, depth in enumerate(depths)
            if depth == depths[outline] + 1 and surrounds(ring, rings[k][0])
        ]
        members = [outline, *holes]
        ears = clip_ears([rings[k] for k in members])
        triangles.append(np.concatenate([indices[k] for k in members])[ears])
    return points, np.concatenate(triangles)


def clip_ears(rings: Sequence[NDArray[np.float64]]) -> NDArray[np.int64]:
    """Non-degenerate, counter-clockwise triangles (m, 3) of a simple polygon with holes.

    Args:
        rings: points (n, 2) of the polygon, then of each hole; triangles index their concatenation.
    """
    points = np.concatenate(rings)
    ends = np.cumsum([len(ring) for ring in rings], dtype=np.uint32)
    triangles: NDArray[np.int64] = triangulate_float64(points, ends).reshape(-1, 3).astype(np.int64)
    a, b, c = (points[triangles[:, k]] for k in range(3))
    areas = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    triangles[areas < 0.0] = triangles[areas < 0.0, ::-1]
    return triangles[areas != 0.0]


def surrounds(ring: NDArray[np.float64], point: NDArray[np.float64]) -> bool:
    """True if a ring encloses a point: a ray from the point crosses it an odd number of times."""
    (x0, y0), (x1, y1) = ring.T, np.roll(ring, -1, axis=0).T
    crosses = (y0 > point[1]) != (y1 > point[1])
    rise = np.where(crosses, y1 - y0, 1.0)
    right = x0 + (point[1] - y0) * (x1 - x0) / rise > point[0]
    return bool(np.count_nonzero(crosses & right) % 2)
