"""Which boxes are behind what was drawn already, by the depth of what was drawn, made coarser.

Depth is reversed (`omnisim.gpu.scene.reversed_depth`): larger is nearer, 0 is
infinitely far. The least
depth in any rectangle of cells is that in four squares and oblongs that cover it, whose sides are
powers of two and which are all looked up in a table.
Source: hierarchical z buffers, Greene, Kass & Miller 1993; the table, Bender & Farach-Colton 2000,
"The LCA problem revisited".
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from omnisim.gpu.culling.frustum_culling import ScreenBounds

CELL = 4  # texels to a side of a cell at least
MOST_CELLS = 24_000  # cells are larger where there would be more
# Cells to a side of the oblongs: what is twice as wide or high is taken to be seen.
LARGEST = 32
_SPARE = 1e-4  # of a depth: what is this close behind a surface is drawn, whatever is rounded


class HiZ:
    """The farthest depth in each cell of an atlas, and in all oblongs of cells.

    Args:
        width_px, height_px: of the atlas.
    """

    def __init__(self, width_px: int, height_px: int):
        self._cell = max(CELL, math.ceil(math.sqrt(width_px * height_px / MOST_CELLS)))
        self._rows, self._columns = -(-height_px // self._cell), -(-width_px // self._cell)
        # By how often both sides are doubled, of the oblong that begins in each cell: one row after
        # the other, so that what begins too far right is nonsense. It is not looked up.
        doublings = (min(cells, LARGEST).bit_length() for cells in (self._rows, self._columns))
        shape = (*doublings, self._rows * self._columns)
        self._farthest = np.zeros(shape, dtype=np.float32)

    def update(self, depth: NDArray[np.float32]) -> None:
        """Take over the depth (height, width) of the atlas."""
        table = self._farthest
        table[0, 0] = _least_of_cells(depth, self._cell).reshape(-1)
        for high in range(table.shape[0]):
            if high:
                _least_of_two(table[high - 1, 0], self._columns << (high - 1), table[high, 0])
            for wide in range(1, table.shape[1]):
                _least_of_two(table[high, wide - 1], 1 << (wide - 1), table[high, wide])

    def hides(self, boxes: ScreenBounds) -> NDArray[np.bool_]:
        """Whether all of what each box (n,) covers is nearer than all of the box."""
        left, top = boxes.first // self._cell
        right, bottom = boxes.last // self._cell
        # the largest powers of two that fit; frexp of an integer gives one more
        across = np.frexp((right - left + 1).astype(np.float32))[1] - 1
        down = np.frexp((bottom - top + 1).astype(np.float32))[1] - 1
        high, wide, _ = self._farthest.shape
        is_small = (across < wide) & (down < high)
        across, down = np.minimum(across, wide - 1), np.minimum(down, high - 1)
        right += 1 - (1 << across)
        bottom += 1 - (1 << down)
        oblong = (down * wide + across) * (self._rows * self._columns)
        upper, lower = oblong + top * self._columns, oblong + bottom * self._columns
        table = self._farthest.reshape(-1)
        farthest = np.minimum(
            np.minimum(table[upper + left], table[upper + right]),
            np.minimum(table[lower + left], table[lower + right]),
        )
        hidden: NDArray[np.bool_] = is_small & (boxes.nearest * (1.0 + _SPARE) < farthest)
        return hidden


def _least_of_two(values: NDArray[np.float32], apart: int, into: NDArray[np.float32]) -> None:
    """The least of each two values that are so far apart."""
    np.minimum(values[:-apart], values[apart:], out=into[:-apart])


def _least_of_cells(values: NDArray[np.float32], by: int) -> NDArray[np.float32]:
    """The least of each `by` × `by` values; what is missing at the end counts for nothing."""
    for axis in (0, 1):
        missing = -values.shape[axis] % by
        if missing:
            values = np.concatenate(
                (values, np.repeat(np.take(values, [-1], axis=axis), missing, axis=axis)), axis=axis
            )
        # `by` slices and not one reduction: those run along memory
        slices = [values[start::by] if axis == 0 else values[:, start::by] for start in range(by)]
        values = slices[0]
        for other in slices[1:]:
            values = np.minimum(values, other)
    return values
