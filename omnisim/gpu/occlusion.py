"""Which boxes are behind what was drawn already, by the depth of what was drawn, made coarser.

Depth is reversed (`omnisim.gpu.reversed_depth`): larger is nearer, 0 is infinitely far.
Source: hierarchical z buffers, Greene, Kass & Miller 1993.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

CELL = 4  # texels to a side of the finest cells
MOST_CELLS = 4  # to a side, that a box is looked up in
_SPARE = 1e-4  # of a depth: what is this close behind a surface is drawn, whatever is rounded


class Outlines(NamedTuple):
    """What boxes cover of the atlas.

    Attributes:
        first, last: (n, 2) texels (column, row), both covered.
        nearest: (n,) depth of the nearest corner; infinite where a box reaches the near plane.
    """

    first: NDArray[np.int64]
    last: NDArray[np.int64]
    nearest: NDArray[np.float32]


def outlines(
    corners: NDArray[np.float32],
    clip_from_box: NDArray[np.float64],
    tiles: NDArray[np.int64],
) -> Outlines:
    """Outlines of boxes in tiles of the atlas; at least a texel wider than what they cover.

    Args:
        corners: (n, 8, 3).
        clip_from_box: (n, 4, 4); depth is z over w.
        tiles: (n, 4), left, top, width and height, texels.
    """
    # One coordinate after the other: BLAS would put so small a product on threads, and wait for
    # them longer than it works.
    x, y, z = np.moveaxis(corners, -1, 0)
    matrices = clip_from_box.astype(np.float32)[..., None]
    clip_x, clip_y, clip_z, w = (
        row[:, 0] * x + row[:, 1] * y + row[:, 2] * z + row[:, 3]
        for row in np.moveaxis(matrices, 1, 0)
    )
    behind = (w <= 1e-6) | (clip_z > w)  # of the viewpoint, or before the near plane
    crosses = behind.any(axis=1)
    scale = 1.0 / np.where(behind, np.float32(1.0), w)
    first, last = np.empty((2, len(corners), 2), dtype=np.int64)
    for axis, across in enumerate((clip_x, clip_y)):
        start, size = tiles[:, axis], tiles[:, 2 + axis]
        on_plane = across * scale  # −1 and 1 are the tile's edges
        low = np.floor(0.5 * size * (on_plane.min(axis=1) + 1.0)) - 1.0
        high = np.floor(0.5 * size * (on_plane.max(axis=1) + 1.0)) + 1.0
        low, high = (np.clip(end, 0, size - 1).astype(np.int64) for end in (low, high))
        first[:, axis] = start + np.where(crosses, 0, low)
        last[:, axis] = start + np.where(crosses, size - 1, high)
    nearest = np.where(crosses, np.float32(np.inf), (clip_z * scale).max(axis=1))
    return Outlines(first, last, nearest)


class CoarseDepth:
    """The farthest depth in each cell of an atlas, and in cells of cells.

    Args:
        depth: (height, width).
    """

    def __init__(self, depth: NDArray[np.float32]):
        self._levels = [_halved_farthest(depth, CELL)]
        while max(self._levels[-1].shape) > 1:
            self._levels.append(_halved_farthest(self._levels[-1], 2))

    def hides(self, boxes: Outlines) -> NDArray[np.bool_]:
        """Whether all of what each box (n,) covers is nearer than all of the box."""
        first, last = boxes.first // CELL, boxes.last // CELL
        # the level where a box covers at most `MOST_CELLS` to a side
        spans = np.maximum((last - first).max(axis=1), 1) / (MOST_CELLS - 1)
        levels = np.maximum(np.ceil(np.log2(spans)), 0.0).astype(np.int64)
        levels = np.minimum(levels, len(self._levels) - 1)
        farthest = np.empty(len(first))
        for number, values in enumerate(self._levels):
            there = np.flatnonzero(levels == number)
            if there.size:
                (left, top), (right, bottom) = (first[there] >> number).T, (last[there] >> number).T
                steps = np.arange(MOST_CELLS)[:, None]
                columns, rows = np.minimum(left + steps, right), np.minimum(top + steps, bottom)
                farthest[there] = values[rows[:, None], columns[None]].min(axis=(0, 1))
        return boxes.nearest * (1.0 + _SPARE) < farthest


def _halved_farthest(values: NDArray[np.float32], by: int) -> NDArray[np.float32]:
    """The smallest of each `by` × `by` values; what is missing at the end counts for nothing."""
    for axis in (0, 1):
        missing = -values.shape[axis] % by
        if missing:
            values = np.concatenate(
                (values, np.repeat(np.take(values, [-1], axis=axis), missing, axis=axis)), axis=axis
            )
        # `by` slices and not one reduction: those run along memory
        values = values if axis == 0 else values.T
        slices = [values[start::by] for start in range(by)]
        least = slices[0]
        for other in slices[1:]:
            least = np.minimum(least, other)
        values = least if axis == 0 else np.ascontiguousarray(least.T)
    return values
