"""Triangulation of polygons in 3D: fans for convex ones, ear clipping for the others."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.scene.polygons import clip_ears

_FLAT = 1e-9  # tolerance relative to the largest turn, against rounding errors at reflex corners


def triangulate(
    points: NDArray[np.floating], counts: NDArray[np.integer], vertices: NDArray[np.integer]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Triangulate planar or nearly planar polygons, in their order.

    Args:
        points: (n, 3) positions.
        counts: (polygons,) number of corners of each; polygons with less than three are dropped.
        vertices: (corners,) indices into `points`, polygon by polygon.

    Returns:
        Triangle corners (m, 3) as indices into `vertices`, and their polygons (m,).
    """
    starts = np.cumsum(counts, dtype=np.int64) - counts
    corners, polygons = [np.zeros((0, 3), np.int64)], [np.zeros(0, np.int64)]
    for count in np.unique(counts[counts >= 3]):
        rows = np.flatnonzero(counts == count)
        loops = starts[rows, None] + np.arange(count)
        positions = points[vertices[loops]].astype(np.float64)
        turns, normals = _turns(positions)
        is_reflex = turns < -_FLAT * np.abs(turns).max(axis=1, keepdims=True)
        # the diagonal of a quad starts at its reflex corner
        first = is_reflex.argmax(axis=1) if count == 4 else np.zeros(len(loops), np.int64)
        is_concave = is_reflex.any(axis=1) & (count > 4)
        corners.append(_fans(loops, first)[~is_concave].reshape(-1, 3))
        polygons.append(np.repeat(rows[~is_concave], count - 2))
        for row in np.flatnonzero(is_concave):
            ears = clip_ears([_projected(positions[row], normals[row])])
            corners.append(loops[row][ears])
            polygons.append(np.full(len(ears), rows[row]))
    every = np.concatenate(polygons)
    order = np.argsort(every, kind="stable")
    return np.concatenate(corners)[order], every[order]


def _fans(loops: NDArray[np.int64], first: NDArray[np.int64]) -> NDArray[np.int64]:
    """Triangle fans (n, k - 2, 3) of polygons (n, k), from the `first` (n,) corner of each."""
    count = loops.shape[1]
    rotated = np.take_along_axis(loops, (first[:, None] + np.arange(count)) % count, axis=1)
    apexes = np.broadcast_to(rotated[:, :1], (len(loops), count - 2))
    return np.stack((apexes, rotated[:, 1:-1], rotated[:, 2:]), axis=2)


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
    """Polygon (k, 2) projected along its normal's main axis, counter-clockwise."""
    axis = int(np.argmax(np.abs(normal)))
    u, v = (axis + 1) % 3, (axis + 2) % 3
    return corners[:, [u, v] if normal[axis] >= 0.0 else [v, u]]
