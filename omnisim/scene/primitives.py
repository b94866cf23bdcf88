"""Triangulated primitive solids, accurate enough for range measurements, and planar polygons.

On round surfaces, the distance of a triangle's points from the true surface is at most
`MAX_DEVIATION` times the radius, or at most `MIN_DEVIATION_M`. Corners lie slightly outside it and
triangle centers slightly inside, so that ranges are unbiased. `max_segments` limits the segments of
a circle, for scenes with many solids.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from mapbox_earcut import triangulate_float64
from numpy.typing import ArrayLike

from omnisim.core.arrays import Floats, Ints, triangle_crosses

MAX_DEVIATION = 5e-4
MIN_DEVIATION_M = 5e-5
MIN_SEGMENTS, MAX_SEGMENTS = 16, 160


class PrimitiveSurface(NamedTuple):
    """Triangles with normals.

    Attributes:
        positions: (n, 3) float64.
        triangles: (m, 3), counter-clockwise seen from outside.
        normals: (n, 3) unit; None: flat shading.
    """

    positions: Floats
    triangles: Ints
    normals: Floats | None


def segments(radius_m: float, max_segments: int = MAX_SEGMENTS) -> int:
    """Number of segments of a circle, a multiple of four."""
    deviation = max(MAX_DEVIATION, MIN_DEVIATION_M / max(radius_m, MIN_DEVIATION_M))
    count = 4 * math.ceil(math.pi / math.acos(1.0 - min(deviation, 1.0)) / 4.0)
    return min(max(count, MIN_SEGMENTS), max_segments)


def rectangle(half_x: float, half_y: float) -> PrimitiveSurface:
    """Rectangle in the plane z = 0, facing up."""
    positions = np.array([(-1.0, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)])
    positions *= (half_x, half_y, 1.0)
    return PrimitiveSurface(positions, np.array([(0, 1, 2), (0, 2, 3)]), None)


def box(half_sizes: ArrayLike) -> PrimitiveSurface:
    """Axis-aligned box at the origin, with half sizes (3,)."""
    square = rectangle(1.0, 1.0)
    faces = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            face = np.roll(square.positions, axis + 1, axis=1)
            face[:, axis] = sign
            order = square.triangles if sign > 0 else square.triangles[:, (0, 2, 1)]
            faces.append(PrimitiveSurface(face * np.asarray(half_sizes, float), order, None))
    return join(*faces)


def ellipsoid(radii: ArrayLike, max_segments: int = MAX_SEGMENTS) -> PrimitiveSurface:
    """Ellipsoid at the origin, with radii (3,)."""
    sizes = np.asarray(radii, dtype=np.float64)
    count = segments(float(sizes.max()), max_segments)
    unit = _dome(count, 0.0, math.pi)
    normals = unit.positions / sizes
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    outside = 2.0 - math.cos(math.pi / count)
    return PrimitiveSurface(unit.positions * sizes * outside, unit.triangles, normals)


def cylinder(
    radius_m: float, half_length_m: float, max_segments: int = MAX_SEGMENTS
) -> PrimitiveSurface:
    """Closed cylinder around the z axis."""
    count = segments(radius_m, max_segments)
    outer = radius_m * _outside(count)
    side = _tube(count, outer, half_length_m)
    caps = [_disc(count, outer, sign * half_length_m) for sign in (-1.0, 1.0)]
    return join(side, *caps)


def capsule(
    radius_m: float, half_length_m: float, max_segments: int = MAX_SEGMENTS
) -> PrimitiveSurface:
    """Capsule around the z axis; the half length excludes the hemispheres."""
    count = segments(radius_m, max_segments)
    top = _dome(count, 0.0, 0.5 * math.pi)
    bottom = _dome(count, 0.5 * math.pi, math.pi)
    offset = np.array([0.0, 0.0, half_length_m])
    outer = radius_m * (2.0 - math.cos(math.pi / count))
    return join(
        _tube(count, outer, half_length_m),
        top._replace(positions=top.positions * outer + offset),
        bottom._replace(positions=bottom.positions * outer - offset),
    )


def cone(
    radius_m: float, half_length_m: float, max_segments: int = MAX_SEGMENTS
) -> PrimitiveSurface:
    """Closed cone around the z axis, tip up."""
    count = segments(radius_m, max_segments)
    outer = radius_m * _outside(count)
    side = _tube(count, outer, half_length_m)
    positions = side.positions.copy()
    positions[count + 1 :, :2] = 0.0
    normals = np.tile(side.positions[: count + 1], (2, 1))
    normals[:, 2] = 0.5 * outer * outer / half_length_m  # perpendicular to the slope
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    slope = PrimitiveSurface(
        positions, side.triangles[::2], normals
    )  # the others degenerate at the tip
    return join(slope, _disc(count, outer, -half_length_m))


def join(*surfaces: PrimitiveSurface) -> PrimitiveSurface:
    """Union of several surfaces; either all of them have normals or none has."""
    starts = np.cumsum([0, *(len(surface.positions) for surface in surfaces)])
    normals = [surface.normals for surface in surfaces if surface.normals is not None]
    triangles = [
        surface.triangles + start for surface, start in zip(surfaces, starts, strict=False)
    ]
    return PrimitiveSurface(
        np.concatenate([surface.positions for surface in surfaces]),
        np.concatenate(triangles),
        np.concatenate(normals) if normals else None,
    )


def grid_triangles(rows: int, columns: int) -> Ints:
    """Triangles (m, 3) of a row-major grid of vertices, with diagonals from (0, 0) to (1, 1).

    With x along the columns and y along the rows, they face up.
    """
    first = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).reshape(-1, 1)
    return np.concatenate(
        (first + (0, 1, columns + 1), first + (0, columns + 1, columns)), axis=1
    ).reshape(-1, 3)


def _outside(count: int) -> float:
    """Circumradius of a polygon that deviates from the unit circle equally outward and inward."""
    return 2.0 / (1.0 + math.cos(math.pi / count))


def _circle(count: int) -> Floats:
    """Unit vectors (count + 1, 2) around a circle; the last repeats the first."""
    angles = np.arange(count + 1) % count * (2.0 * math.pi / count)
    return np.stack((np.cos(angles), np.sin(angles)), axis=1)


def _dome(count: int, first_rad: float, last_rad: float) -> PrimitiveSurface:
    """Part of the unit sphere between two polar angles from +z."""
    steps = max(2, round((last_rad - first_rad) * count / (2.0 * math.pi)))
    polar = np.linspace(first_rad, last_rad, steps + 1)[:, None]
    circle = _circle(count)
    x, y, z = np.sin(polar) * circle[:, 0], np.sin(polar) * circle[:, 1], np.cos(polar)
    positions = np.stack(np.broadcast_arrays(x, y, z), axis=-1).reshape(-1, 3)
    triangles = grid_triangles(steps + 1, count + 1)[:, ::-1]
    area = np.linalg.norm(triangle_crosses(positions[triangles]), axis=1)
    return PrimitiveSurface(
        positions, triangles[area > 1e-12], positions
    )  # drops zero areas at the poles


def _tube(count: int, radius_m: float, half_length_m: float) -> PrimitiveSurface:
    normals = np.concatenate((_circle(count), np.zeros((count + 1, 1))), axis=1)
    normals = np.concatenate((normals, normals))
    positions = normals * radius_m
    positions[: count + 1, 2] = -half_length_m
    positions[count + 1 :, 2] = half_length_m
    return PrimitiveSurface(positions, grid_triangles(2, count + 1), normals)


def _disc(count: int, radius_m: float, z_m: float) -> PrimitiveSurface:
    """Disc facing up if z is positive, otherwise down."""
    rim = np.concatenate((_circle(count)[:-1] * radius_m, np.full((count, 1), z_m)), axis=1)
    corners = np.arange(count)
    triangles = np.stack((np.full(count, count), corners, (corners + 1) % count), axis=1)
    up = math.copysign(1.0, z_m)
    return PrimitiveSurface(
        np.concatenate((rim, [[0.0, 0.0, z_m]])),
        triangles if up > 0 else triangles[:, ::-1],
        np.tile((0.0, 0.0, up), (count + 1, 1)),
    )


# Triangulation of planar polygons with holes.


def triangulate(loops: Sequence[ArrayLike]) -> tuple[Floats, Ints]:
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
        inner = [k for k, depth in enumerate(depths) if depth == depths[outline] + 1]
        members = [outline, *(k for k in inner if surrounds(ring, rings[k][0]))]
        ears = clip_ears([rings[k] for k in members])
        triangles.append(np.concatenate([indices[k] for k in members])[ears])
    return points, np.concatenate(triangles)


def clip_ears(rings: Sequence[Floats]) -> Ints:
    """Non-degenerate, counter-clockwise triangles (m, 3) of a simple polygon with holes.

    Args:
        rings: points (n, 2) of the polygon, then of each hole; triangles index their concatenation.
    """
    points = np.concatenate(rings)
    ends = np.cumsum([len(ring) for ring in rings], dtype=np.uint32)
    triangles: Ints = triangulate_float64(points, ends).reshape(-1, 3).astype(np.int64)
    a, b, c = (points[triangles[:, k]] for k in range(3))
    areas = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    triangles[areas < 0.0] = triangles[areas < 0.0, ::-1]
    return triangles[areas != 0.0]


def surrounds(ring: Floats, point: Floats) -> bool:
    """True if a ring encloses a point: a ray from the point crosses it an odd number of times."""
    (x0, y0), (x1, y1) = ring.T, np.roll(ring, -1, axis=0).T
    crosses = (y0 > point[1]) != (y1 > point[1])
    rise = np.where(crosses, y1 - y0, 1.0)
    right = x0 + (point[1] - y0) * (x1 - x0) / rise > point[0]
    return bool(np.count_nonzero(crosses & right) % 2)
