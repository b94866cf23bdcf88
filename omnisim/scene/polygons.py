"""Triangulation of plane polygons with holes, by ear clipping."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

_Point = tuple[float, float]


def triangulate(loops: Sequence[ArrayLike]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Triangulate the inside of closed loops: what an odd number of them surrounds.

    Args:
        loops: points (n, 2) of each, in either direction, the first not repeated at the end; they
            do not cross.

    Returns:
        Points (p, 2) of all loops, one after the other, and triangles (m, 3), counter-clockwise.
    """
    rings = [np.asarray(loop, dtype=np.float64).reshape(-1, 2) for loop in loops]
    starts = np.cumsum([0, *map(len, rings)])
    depths = [sum(surrounds(other, ring[0]) for other in rings if other is not ring)
              for ring in rings]  # fmt: skip
    points = np.concatenate(rings) if rings else np.zeros((0, 2))
    found: list[tuple[int, int, int]] = []
    for index, ring in enumerate(rings):
        if depths[index] % 2:
            continue
        outline = _turned(ring, starts[index], is_left=True)
        holes = [
            _turned(rings[k], starts[k], is_left=False)
            for k, depth in enumerate(depths)
            if depth == depths[index] + 1 and surrounds(ring, rings[k][0])
        ]
        for hole in sorted(holes, key=lambda hole: -points[hole, 0].max()):
            outline = _bridged(outline, hole, points)
        found += _clip_ears(outline, points)
    return points, np.array(found, dtype=np.int64).reshape(-1, 3)


def _turned(ring: NDArray[np.float64], start: int, is_left: bool) -> list[int]:
    """Indices of a ring's points, counter-clockwise or clockwise."""
    x, y = ring.T
    area = float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
    indices = list(range(start, start + len(ring)))
    return indices if (area > 0.0) == is_left else indices[::-1]


def surrounds(ring: NDArray[np.float64], point: NDArray[np.float64]) -> bool:
    """True for a point inside of a ring: a ray from it crosses the ring an odd number of times."""
    (x0, y0), (x1, y1) = ring.T, np.roll(ring, -1, axis=0).T
    crosses = (y0 > point[1]) != (y1 > point[1])
    rise = np.where(crosses, y1 - y0, 1.0)
    right = x0 + (point[1] - y0) * (x1 - x0) / rise > point[0]
    return bool(np.count_nonzero(crosses & right) % 2)


def _bridged(outline: list[int], hole: list[int], points: NDArray[np.float64]) -> list[int]:
    """Outline that goes into a hole and back, from the nearest corner that sees it.

    Source: David Eberly, Triangulation by Ear Clipping.
    """
    first = max(range(len(hole)), key=lambda k: float(points[hole[k], 0]))
    inner = [*hole[first:], *hole[: first + 1]]
    target = _pair(points[hole[first]])
    order = sorted(range(len(outline)), key=lambda k: _distance(points[outline[k]], target))
    for k in order:
        corner = _pair(points[outline[k]])
        edges = zip(outline, [*outline[1:], outline[0]], strict=True)
        edges_of_hole = zip(hole, [*hole[1:], hole[0]], strict=True)
        if not any(
            _cross(corner, target, _pair(points[a]), _pair(points[b]))
            for a, b in (*edges, *edges_of_hole)
        ):
            return [*outline[: k + 1], *inner, *outline[k:]]
    return outline  # loops that cross: the hole is filled


def _clip_ears(outline: list[int], points: NDArray[np.float64]) -> list[tuple[int, int, int]]:
    rest, found = list(outline), []
    at = 0
    misses = 0
    while len(rest) > 3 and misses <= len(rest):
        a, b, c = rest[at - 1], rest[at % len(rest)], rest[(at + 1) % len(rest)]
        if _is_ear(a, b, c, rest, points):
            if _area(points[a], points[b], points[c]) > 0.0:
                found.append((a, b, c))
            del rest[at % len(rest)]
            misses = 0
        else:
            at, misses = at + 1, misses + 1
        at %= len(rest)
    if len(rest) == 3 and _area(*(points[k] for k in rest)) > 0.0:
        found.append((rest[0], rest[1], rest[2]))
    return found


def _is_ear(a: int, b: int, c: int, rest: list[int], points: NDArray[np.float64]) -> bool:
    corner = points[[a, b, c]]
    area = _area(*corner)
    if area <= 0.0:
        return area == 0.0  # a straight corner, or a bridge's end: it goes without a triangle
    others = points[[k for k in rest if k not in (a, b, c)]]
    if not len(others):
        return True
    edges = np.roll(corner, -1, axis=0) - corner
    away = others[:, None] - corner
    sides = edges[:, 0] * away[..., 1] - edges[:, 1] * away[..., 0]
    same = (others[:, None] == corner).all(axis=2).any(axis=1)  # the other side of a bridge
    return not bool(((sides >= 0.0).all(axis=1) & ~same).any())


def _area(a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64]) -> float:
    """Twice the area, positive to the left."""
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


def _pair(point: NDArray[np.float64]) -> _Point:
    return float(point[0]), float(point[1])


def _distance(point: NDArray[np.float64], target: _Point) -> float:
    return (float(point[0]) - target[0]) ** 2 + (float(point[1]) - target[1]) ** 2


def _cross(p: _Point, q: _Point, a: _Point, b: _Point) -> bool:
    """True for segments that cross, not where they only share an end."""

    def side(o: _Point, d: _Point, s: _Point) -> float:
        return (d[0] - o[0]) * (s[1] - o[1]) - (d[1] - o[1]) * (s[0] - o[0])

    if {p, q} & {a, b}:
        return False
    return side(p, q, a) * side(p, q, b) <= 0.0 and side(a, b, p) * side(a, b, q) <= 0.0
