"""Rectangles that cover a picture's valid pixels: what lies outside of a mirror is not drawn."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

ROWS = 8  # of a rectangle


def covering(valid: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Corners (n, 2) in pixels (right, down) of triangles that cover all valid pixels, three a
    triangle; the picture's first corner is (0, 0). None, where nothing is valid.

    Args:
        valid: (height, width).
    """  # fmt: skip
    height = len(valid)
    triangles = []
    for top in range(0, height, ROWS):
        columns = np.flatnonzero(valid[top : top + ROWS].any(axis=0))
        if not columns.size:
            continue
        left, right = int(columns[0]), int(columns[-1]) + 1
        bottom = min(top + ROWS, height)
        triangles += [(left, top), (right, top), (left, bottom)]
        triangles += [(left, bottom), (right, top), (right, bottom)]
    return np.array(triangles, dtype=np.float32).reshape(-1, 2)
