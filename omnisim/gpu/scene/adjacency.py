"""Which triangles of a mesh lie beside each other, whatever vertices they were given."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

NO_NEIGHBOUR = np.uint32(0xFFFFFFFF)


def neighbours(positions: NDArray[np.float32], triangles: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """Triangles (m, 3) beyond the edges opposite to each triangle's first, second, third corner.

    Corners at the same place are one, even where normals or texture coordinates differ. Where more
    than two triangles meet at an edge, each has the next one; `NO_NEIGHBOUR`: there is none.

    Args:
        positions: (n, 3).
        triangles: (m, 3).
    """
    if not len(triangles):
        return np.empty((0, 3), dtype=np.uint32)
    places = np.ascontiguousarray(positions + np.float32(0.0))  # −0 is 0
    _, corners = np.unique(places.view("V12").ravel(), return_inverse=True)
    ends = corners[triangles][:, [[1, 2], [2, 0], [0, 1]]].reshape(-1, 2)
    ends = np.sort(ends, axis=1).astype(np.int64)
    keys = ends[:, 0] * len(positions) + ends[:, 1]
    order = np.argsort(keys, kind="stable")
    is_new = np.append(True, np.diff(keys[order]) != 0)
    starts = np.flatnonzero(is_new)
    counts = np.diff(np.append(starts, len(keys)))
    place = np.arange(len(keys))
    following = place + 1
    last = starts + counts - 1
    following[last] = starts  # around in a ring
    found = np.full(len(keys), NO_NEIGHBOUR)
    shared = np.repeat(counts > 1, counts)
    found[order[shared]] = order[following[shared]] // 3
    return found.reshape(-1, 3)
