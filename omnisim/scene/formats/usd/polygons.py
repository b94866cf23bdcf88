"""Triangulation of polygons: fans of convex ones, ear clipping of the others."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Ears of a polygon cost its square: larger ones, which nobody draws, become fans.
MAX_CLIPPED = 4000
_FLAT = 1e-9  # of the area: corners that are reflex by rounding alone


def triangulate(
    points: NDArray[np.floating], counts: NDArray[np.integer], vertices: NDArray[np.integer]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Triangulate polygons, planar or nearly so, in the order of the polygons.

    Args:
        points: (n, 3) positions.
        counts: (polygons,) corners of each; those of less than three are left out.
        vertices: (corners,) indices into `points`, polygon after polygon.

    Returns:
        Corners (m, 3) of the triangles, indices into `vertices`, and their polygons (m,).
    """
    starts = np.cumsum(counts, dtype=np.int64) - counts
    corners, polygons = [np.zeros((0, 3), np.int64)], [np.zeros(0, np.int64)]
    for count in np.unique(counts[counts >= 3]):
        rows = np.flatnonzero(counts == count)
        loops = starts[rows, None] + np.arange(count)
        found = loops[:, None] if count == 3 else _triangulate_loops(points, vertices, loops)
        corners.append(found.reshape(-1, 3))
        polygons.append(np.repeat(rows, count - 2))
    every = np.concatenate(polygons)
    order = np.argsort(every, kind="stable")
    return np.concatenate(corners)[order], every[order]


def _triangulate_loops(
    points: NDArray[np.floating], vertices: NDArray[np.integer], loops: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Triangles (n, k - 2, 3) of polygons of k corners: loops (n, k) of indices of corners."""
    count = loops.shape[1]
    first, steps = np.zeros(len(loops), np.int64), np.arange(1, count - 1)
    corners = points[vertices[loops]].astype(np.float64)
    turns, normals = _turns(corners)
    reflex = turns < -_FLAT * np.abs(turns).max(axis=1, keepdims=True)
    if count == 4:  # the diagonal begins at the reflex corner
        first = np.where(reflex.any(axis=1), reflex.argmax(axis=1), 0)
    rotated = np.take_along_axis(loops, (first[:, None] + np.arange(count)) % count, axis=1)
    apexes = np.broadcast_to(rotated[:, :1], (len(loops), count - 2))
    triangles = np.stack((apexes, rotated[:, steps], rotated[:, steps + 1]), axis=2)
    if 4 < count <= MAX_CLIPPED:
        for row in np.flatnonzero(reflex.any(axis=1)):
            triangles[row] = loops[row][_clip_ears(_projected(corners[row], normals[row]))]
    return triangles


def _turns(
    corners: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Turns (n, k) of polygons (n, k, 3), negative at reflex corners, and unit normals (n, 3).

    Source: Newell's normal; Sutherland et al., "A Characterization of Ten Hidden-Surface
    Algorithms", 1974.
    """
    after, before = np.roll(corners, -1, axis=1), np.roll(corners, 1, axis=1)
    origin = corners[:, :1]
    normals = np.cross(corners - origin, after - origin).sum(axis=1)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0.0)
    crossed = np.cross(corners - before, after - corners)
    return np.einsum("nkd,nd->nk", crossed, normals), normals


def _projected(corners: NDArray[np.float64], normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Polygon (k, 2) counter-clockwise in a plane across its normal."""
    axis = int(np.argmax(np.abs(normal)))
    u, v = (axis + 1) % 3, (axis + 2) % 3
    return corners[:, [u, v] if normal[axis] >= 0.0 else [v, u]]


def _clip_ears(polygon: NDArray[np.float64]) -> NDArray[np.int64]:
    """Triangles (k - 2, 3) of a simple polygon (k, 2), counter-clockwise.

    Source: Meisters, "Polygons Have Ears", 1975.
    """
    left = np.arange(len(polygon))
    triangles = []
    while len(left) > 3:
        before, after = np.roll(left, 1), np.roll(left, -1)
        a, b, c = polygon[before], polygon[left], polygon[after]
        turns = _cross(b - a, c - b)
        # the widest first: fewer slivers; without an ear it is no simple polygon
        order = np.argsort(-turns, kind="stable")
        ear = next((at for at in order if turns[at] > 0.0 and _is_ear(polygon, left, at)), order[0])
        triangles.append((before[ear], left[ear], after[ear]))
        left = np.delete(left, ear)
    return np.array([*triangles, left], dtype=np.int64)


def _is_ear(polygon: NDArray[np.float64], left: NDArray[np.int64], at: int) -> bool:
    """True where no corner that is left lies inside of the triangle at a corner."""
    a, b, c = polygon[left[[at - 1, at, (at + 1) % len(left)]]]
    others = polygon[left]
    inside = (_cross(b - a, others - a) > 0.0) & (_cross(c - b, others - b) > 0.0)
    return not np.any(inside & (_cross(a - c, others - c) > 0.0))


def _cross(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    product: NDArray[np.float64] = first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]
    return product
