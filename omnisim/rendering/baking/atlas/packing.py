"""Packing of rectangles of texels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def pack(sizes_px: NDArray[np.intp]) -> tuple[NDArray[np.intp], tuple[int, int]]:
    """Place rectangles of sizes (n, 2) side by side; return them (n, 4) and the page's size.

    Taller rectangles are placed first; each is as near to the top as earlier ones allow.
    """
    rects = np.zeros((len(sizes_px), 4), dtype=np.intp)
    used = np.flatnonzero(sizes_px.min(axis=1, initial=1))
    if not len(used):
        return rects, (1, 1)
    sizes = sizes_px[used]
    width = max(int(sizes[:, 0].max()), int(np.ceil(np.sqrt(sizes.prod(axis=1).sum()))))
    ends = np.zeros(width, dtype=np.intp)  # bottom of the occupied part of each column
    for at in np.lexsort((used, -sizes[:, 0], -sizes[:, 1])):
        wide, high = sizes[at]
        tops = np.lib.stride_tricks.sliding_window_view(ends, wide).max(axis=1)
        left = int(tops.argmin())
        top = int(tops[left])
        ends[left : left + wide] = top + high
        rects[used[at]] = left, top, wide, high
    return rects, (width, int(ends.max()))
