"""Hierarchical z buffer: occlusion tests of boxes against the depth of an atlas.

Depth is reversed (`omnisim.gpu.scene.reversed_depth`): larger is nearer, 0 is infinitely far. The
farthest depth in any rectangle of cells is that in four rectangles that cover it, whose sides are
powers of two, looked up in a sparse table.
Source: hierarchical z buffers, Greene, Kass & Miller 1993; the sparse table, Bender &
Farach-Colton 2000, "The LCA problem revisited".
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from omnisim.gpu.culling.frustum_culling import ScreenBounds

MIN_CELL_PX = 4
MAX_CELLS = 24_000  # cells are larger where there would be more
MAX_SIDE = 32  # cells of the table's rectangles: twice as large a box counts as visible
_TOLERANCE = 1e-4  # of a depth: what is this close behind a surface is drawn, whatever is rounded


class HiZ:
    """Farthest depth in each rectangle of cells of an atlas, with sides of powers of two.

    Args:
        width_px, height_px: of the atlas.
    """

    def __init__(self, width_px: int, height_px: int):
        self._cell_px = max(MIN_CELL_PX, math.ceil(math.sqrt(width_px * height_px / MAX_CELLS)))
        self._rows, self._columns = -(-height_px // self._cell_px), -(-width_px // self._cell_px)
        # By the logarithms of height and width, of the rectangle that begins in each cell: one row
        # after the other, so that one that begins too far right is nonsense. It is not looked up.
        levels = (min(cells, MAX_SIDE).bit_length() for cells in (self._rows, self._columns))
        self._farthest = np.zeros((*levels, self._rows * self._columns), dtype=np.float32)

    def update(self, depth: NDArray[np.float32]) -> None:
        """Take over the depth (height, width) of the atlas."""
        table = self._farthest
        table[0, 0] = _min_of_cells(depth, self._cell_px).reshape(-1)
        for high in range(table.shape[0]):
            if high:
                _min_of_pairs(table[high - 1, 0], self._columns << (high - 1), table[high, 0])
            for wide in range(1, table.shape[1]):
                _min_of_pairs(table[high, wide - 1], 1 << (wide - 1), table[high, wide])

    def occludes(self, boxes: ScreenBounds) -> NDArray[np.bool_]:
        """Occlusion (n,) of boxes: all that each covers is nearer than all of the box."""
        left, top = boxes.first // self._cell_px
        right, bottom = boxes.last // self._cell_px
        # the largest powers of two that fit; frexp of an integer gives one more
        across = np.frexp((right - left + 1).astype(np.float32))[1] - 1
        down = np.frexp((bottom - top + 1).astype(np.float32))[1] - 1
        high, wide, _ = self._farthest.shape
        is_small = (across < wide) & (down < high)
        across, down = np.minimum(across, wide - 1), np.minimum(down, high - 1)
        right += 1 - (1 << across)
        bottom += 1 - (1 << down)
        size = (down * wide + across) * (self._rows * self._columns)
        upper, lower = size + top * self._columns, size + bottom * self._columns
        table = self._farthest.reshape(-1)
        farthest = np.minimum(
            np.minimum(table[upper + left], table[upper + right]),
            np.minimum(table[lower + left], table[lower + right]),
        )
        occluded: NDArray[np.bool_] = is_small & (boxes.nearest * (1.0 + _TOLERANCE) < farthest)
        return occluded


def _min_of_pairs(values: NDArray[np.float32], stride: int, into: NDArray[np.float32]) -> None:
    """Minimum of each two values a stride apart."""
    np.minimum(values[:-stride], values[stride:], out=into[:-stride])


def _min_of_cells(values: NDArray[np.float32], side: int) -> NDArray[np.float32]:
    """Minimum of each `side` × `side` values; missing ones at the end count for nothing."""
    for axis in (0, 1):
        missing = -values.shape[axis] % side
        if missing:
            values = np.concatenate(
                (values, np.repeat(np.take(values, [-1], axis=axis), missing, axis=axis)), axis=axis
            )
        # `side` slices and not one reduction: those run along memory
        slices = [values[at::side] if axis == 0 else values[:, at::side] for at in range(side)]
        values = slices[0]
        for other in slices[1:]:
            values = np.minimum(values, other)
    return values
