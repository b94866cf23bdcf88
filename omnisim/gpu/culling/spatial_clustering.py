"""An order in which near boxes follow each other, and where to cut it: compact pieces of anything.

Boxes are put along a Morton curve. Its cells, each half of a larger one, are gone through from the
smallest to the whole: halves stay together where one box around them is hardly larger than one
around each.
Source: cells of the curve as a tree, Lauterbach et al. 2009, "Fast BVH construction on GPUs"; the
measure of what a box costs, Goldsmith & Salmon 1987, "Automatic creation of object hierarchies".
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

BITS = 12  # of a Morton code, along each axis
# What spreads the bits of a number, so that two others fit between them: how far a half of it is
# moved, and which bits count afterwards.
_SPREADING = (
    (32, 0x1F00000000FFFF),
    (16, 0x1F0000FF0000FF),
    (8, 0x100F00F00F00F00F),
    (4, 0x10C30C30C30C30C3),
    (2, 0x1249249249249249),
)


def spatial_order(
    ends: NDArray[np.float32],
    kinds: NDArray[np.integer],
    least: int,
    most: int,
    worth_a_cut: float,
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Order in which near boxes follow each other, kind by kind, and where to cut it into pieces.

    Args:
        ends: (6, n), the boxes' low corners times −1, then their high ones: the largest of several
            is the box around them.
        kinds: (n,) from 0; those of one piece are the same.
        least: so few boxes of one small cell are not cut further.
        most: boxes of a piece.
        worth_a_cut: what the best cuts have to make so many times smaller, surface times content,
            is cut. Fewer pieces are less to look at, more of them show less of what is hidden.

    Returns:
        The order (n,), and the first of each piece, counted in that order.
    """
    total = ends.shape[1]
    bits = min(BITS, (64 - int(kinds.max()).bit_length()) // 3)
    codes = _morton(0.5 * (ends[3:] - ends[:3]), bits)
    codes |= kinds.astype(np.uint64) << np.uint64(3 * bits)
    order = np.argsort(codes, kind="stable")
    codes = codes[order]
    # Where each begins: the level of the smallest cell that it is in together with the one before.
    # There is none for the first one, and for those of different kinds.
    levels = np.full(total, 3 * bits + 1)
    differing = (codes[1:] ^ codes[:-1]).astype(np.float64)
    np.minimum(np.frexp(differing)[1], 3 * bits + 1, out=levels[1:])
    first, levels = _in_small_cells(levels, 3 * bits, least)
    around = np.maximum.reduceat(ends[:, order], first, axis=1)
    starts, counts = _joined(around, first, levels, total, 3 * bits, most, worth_a_cut)
    # what is joined has no cut after its first, whatever of it was joined before
    joined = np.bincount(starts + 1, minlength=total + 1)
    joined -= np.bincount(starts + counts, minlength=total + 1)
    first = first[np.cumsum(joined)[first] == 0]
    return order, _no_larger(first, total, most)


def _in_small_cells(
    levels: NDArray[np.intp], last_level: int, least: int
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First of each of the largest cells that have `least` or fewer, and the level it begins at."""
    first, total = np.arange(len(levels)), len(levels)
    for level in range(last_level + 1):
        heads = np.flatnonzero(levels > level)
        if len(heads) == len(levels):
            continue
        counts = np.diff(first[heads], append=total)
        stays = np.repeat(counts > least, np.diff(heads, append=len(levels)))
        stays[heads] = True
        if stays.all():
            break
        first, levels = first[stays], levels[stays]
    return first, levels


def _joined(
    around: NDArray[np.float32],
    first: NDArray[np.intp],
    levels: NDArray[np.intp],
    total: int,
    last_level: int,
    most: int,
    worth_a_cut: float,
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First and number of boxes of each cell that is better left in one piece, of any level.

    Args:
        around: (6, n), what is around the boxes from each of `first` on.
        first, levels: (n,).
        total: boxes.
        last_level: of the cell with everything.
        most, worth_a_cut: see `spatial_order`.
    """
    counts = np.diff(first, append=total)
    costs = _surfaces(around) * counts
    starts, sizes = [first[:0]], [counts[:0]]
    for level in range(last_level + 1):
        heads = np.flatnonzero(levels > level)
        if len(heads) == len(levels):
            continue
        parts = np.diff(heads, append=len(levels))
        around = np.maximum.reduceat(around, heads, axis=1)
        counts, costs = np.add.reduceat(counts, heads), np.add.reduceat(costs, heads)
        first, levels = first[heads], levels[heads]
        whole = _surfaces(around) * counts
        better = (parts > 1) & (counts <= most) & (whole <= worth_a_cut * costs)
        costs = np.minimum(whole, costs)
        starts.append(first[better])
        sizes.append(counts[better])
        if counts.min() > most:
            break
    return np.concatenate(starts), np.concatenate(sizes)


def _no_larger(first: NDArray[np.intp], total: int, most: int) -> NDArray[np.intp]:
    """The same cuts and more: no piece has more than `most`."""
    pieces = -(-np.diff(first, append=total) // most)
    number = np.arange(pieces.sum()) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    return np.repeat(first, pieces) + most * number


def _surfaces(around: NDArray[np.float32]) -> NDArray[np.float32]:
    """Half the surface (n,) of boxes (6, n)."""
    x, y, z = around[:3] + around[3:]
    surfaces: NDArray[np.float32] = x * y + y * z + z * x
    return surfaces


def _morton(places: NDArray[np.float32], bits: int) -> NDArray[np.uint64]:
    """One number for each place (3, n), `bits` bits of each axis: near places, near numbers."""
    start = places.min(axis=1, keepdims=True)
    extent = max(float((places - start).max()), 1e-9)
    cells = ((places - start) * (((1 << bits) - 1) / extent)).astype(np.uint64)
    codes = np.zeros(places.shape[1], dtype=np.uint64)
    for axis, cell in enumerate(cells):
        for shift, mask in _SPREADING:
            cell = (cell | (cell << np.uint64(shift))) & np.uint64(mask)
        codes |= cell << np.uint64(axis)
    return codes
