"""Adjacency of a mesh's triangles by the positions of their corners."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

NO_NEIGHBOR = np.uint32(0xFFFFFFFF)


def neighbors(positions: NDArray[np.float32], triangles: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """Adjacent triangles (m, 3) beyond the edges opposite to each triangle's corners.

    Corners at the same place count as one, even if normals or texture coordinates differ. If more
    than two triangles share an edge, each gets the next one; `NO_NEIGHBOR`: an open edge.

    Args:
        positions: (n, 3) positions of the vertices.
        triangles: (m, 3) vertex indices.
    """
    if not len(triangles):
        return np.empty((0, 3), dtype=np.uint32)
    points = np.ascontiguousarray(positions + np.float32(0.0))  # turns −0 into 0
    _, corners = np.unique(points.view("V12").ravel(), return_inverse=True)
    edges = corners[triangles][:, [[1, 2], [2, 0], [0, 1]]].reshape(-1, 2)
    edges = np.sort(edges, axis=1).astype(np.int64)
    keys = edges[:, 0] * len(positions) + edges[:, 1]
    order = np.argsort(keys, kind="stable")
    starts = np.flatnonzero(np.diff(keys[order], prepend=-1))
    counts = np.diff(starts, append=len(keys))
    following = np.arange(1, len(keys) + 1)
    following[starts + counts - 1] = starts  # the last one gets the first
    adjacent = np.full(len(keys), NO_NEIGHBOR)
    is_shared = np.repeat(counts > 1, counts)
    adjacent[order[is_shared]] = order[following[is_shared]] // 3
    return adjacent.reshape(-1, 3)
