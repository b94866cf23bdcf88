"""Spatial clustering: an order in which near boxes follow each other, split into compact runs.

Boxes are put along a Morton curve. Its cells, each half of a larger one, are visited from the
smallest to the whole: halves stay together where one box around them is hardly larger than one
around each.
Source: cells of the curve as a tree, Lauterbach et al. 2009, "Fast BVH construction on GPUs"; the
surface area heuristic, Goldsmith & Salmon 1987, "Automatic creation of object hierarchies".
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Along each axis; as many as there are where more boxes share a cell than a cluster may have.
MORTON_BITS, MOST_MORTON_BITS = 12, 20
# Steps that spread the bits of a number, so that two others fit between them: shift and mask.
_SPREAD_STEPS = (
    (32, 0x1F00000000FFFF),
    (16, 0x1F0000FF0000FF),
    (8, 0x100F00F00F00F00F),
    (4, 0x10C30C30C30C30C3),
    (2, 0x1249249249249249),
)


def spatial_clusters(
    bounds: NDArray[np.float32],
    keys: NDArray[np.integer],
    min_size: int,
    max_size: int,
    split_factor: float,
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Order boxes so that near ones follow each other, key by key, and split the order.

    Args:
        bounds: (6, n), the boxes' least corners times −1, then their largest: the maximum of
            several is the box around them.
        keys: (n,) from 0; those of one cluster are equal.
        min_size: as few boxes of one small cell are not split.
        max_size: boxes of a cluster.
        split_factor: a cell is split where the best split makes surface area times content as many
            times smaller. Fewer clusters cost less to test, more of them cull more tightly.

    Returns:
        The order (n,), and the first of each cluster, counted in that order.
    """
    total = bounds.shape[1]
    order, codes, bits = _order(bounds, keys, MORTON_BITS)
    if _longest_run(codes) > max_size:
        keys = np.unique(keys, return_inverse=True)[1]  # leaves more bits
        order, codes, bits = _order(bounds, keys, MOST_MORTON_BITS)
    levels, last_level = _levels(codes, bits, min_size, max_size)
    first, levels = _merge_small_cells(levels, last_level, min_size)
    cell_bounds = np.maximum.reduceat(bounds[:, order], first, axis=1)
    starts, counts = _merge_cells(
        cell_bounds, first, levels, total, last_level, max_size, split_factor
    )
    # merged boxes are not split after the first, whatever of them was merged before
    merged = np.bincount(starts + 1, minlength=total + 1)
    merged -= np.bincount(starts + counts, minlength=total + 1)
    first = first[np.cumsum(merged)[first] == 0]
    return order, _split_to_size(first, total, max_size)


def _levels(
    codes: NDArray[np.uint64], bits: int, min_size: int, max_size: int
) -> tuple[NDArray[np.intp], int]:
    """Levels (n,) at which boxes begin, by their codes in order; and the last one.

    Each is of the smallest cell that a box shares with the one before. Of boxes in one cell of the
    smallest, runs of `min_size` and then `max_size` count as cells of the lowest levels.
    """
    total, last_level = len(codes), 3 * bits + 1
    # the first box shares no cell, nor do those of different keys
    levels = np.full(total, last_level + 1)
    differing = (codes[1:] ^ codes[:-1]).astype(np.float64)
    differs = differing > 0.0
    exponents = np.frexp(differing)[1][differs]
    levels[1:][differs] = np.minimum(exponents + 1, last_level + 1)
    numbers = np.arange(total)
    levels[1:][~differs] = 0
    in_cell = numbers - np.maximum.accumulate(np.where(levels > 0, numbers, 0))
    for level, size in ((1, min_size), (2, max_size)):
        levels[(in_cell > 0) & (in_cell % size == 0)] = level
    return levels, last_level


def _merge_small_cells(
    levels: NDArray[np.intp], last_level: int, min_size: int
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First box of each of the largest cells of `min_size` or fewer, and the level it begins at."""
    first, total = np.arange(len(levels)), len(levels)
    for level in range(last_level + 1):
        heads = np.flatnonzero(levels > level)
        if len(heads) == len(levels):
            continue
        counts = np.diff(first[heads], append=total)
        stays = np.repeat(counts > min_size, np.diff(heads, append=len(levels)))
        stays[heads] = True
        if counts.min() > min_size:
            break
        first, levels = first[stays], levels[stays]
    return first, levels


def _merge_cells(
    bounds: NDArray[np.float32],
    first: NDArray[np.intp],
    levels: NDArray[np.intp],
    total: int,
    last_level: int,
    max_size: int,
    split_factor: float,
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First and number of boxes of each cell, of any level, that is better not split.

    `bounds` (6, n) are of the boxes from each of `first` (n,) on, which begin at `levels` (n,).
    """
    counts = np.diff(first, append=total)
    costs = _half_areas(bounds) * counts
    starts, sizes = [first[:0]], [counts[:0]]
    for level in range(last_level + 1):
        heads = np.flatnonzero(levels > level)
        if len(heads) == len(levels):
            continue
        children = np.diff(heads, append=len(levels))
        bounds = np.maximum.reduceat(bounds, heads, axis=1)
        counts, costs = np.add.reduceat(counts, heads), np.add.reduceat(costs, heads)
        first, levels = first[heads], levels[heads]
        whole = _half_areas(bounds) * counts
        better = (children > 1) & (counts <= max_size) & (whole <= split_factor * costs)
        costs = np.minimum(whole, costs)
        starts.append(first[better])
        sizes.append(counts[better])
        if counts.min() > max_size:
            break
    return np.concatenate(starts), np.concatenate(sizes)


def _split_to_size(first: NDArray[np.intp], total: int, max_size: int) -> NDArray[np.intp]:
    """First of each cluster, those of more than `max_size` split."""
    parts = -(-np.diff(first, append=total) // max_size)
    number = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
    starts: NDArray[np.intp] = np.repeat(first, parts) + max_size * number
    return starts


def _order(
    bounds: NDArray[np.float32], keys: NDArray[np.integer], most_bits: int
) -> tuple[NDArray[np.intp], NDArray[np.uint64], int]:
    """Order of boxes (6, n) by key and Morton code, these codes in order, and bits of an axis."""
    bits = min(most_bits, (64 - int(keys.max()).bit_length()) // 3)
    codes = _morton_codes(0.5 * (bounds[3:] - bounds[:3]), bits)
    codes |= keys.astype(np.uint64) << np.uint64(3 * bits)
    order = np.argsort(codes, kind="stable")
    return order, codes[order], bits


def _longest_run(values: NDArray[np.uint64]) -> int:
    """Length of the longest run of equal values (n,), in order."""
    starts = np.flatnonzero(np.append(True, values[1:] != values[:-1]))
    return int(np.diff(starts, append=len(values)).max())


def _half_areas(bounds: NDArray[np.float32]) -> NDArray[np.float32]:
    """Half the surface area (n,) of boxes (6, n)."""
    x, y, z = bounds[:3] + bounds[3:]
    areas: NDArray[np.float32] = x * y + y * z + z * x
    return areas


def _morton_codes(centers: NDArray[np.float32], bits: int) -> NDArray[np.uint64]:
    """Morton codes of points (3, n), `bits` bits of each axis."""
    start = centers.min(axis=1, keepdims=True)
    extent = max(float((centers - start).max()), 1e-9)
    cells = ((centers - start) * (((1 << bits) - 1) / extent)).astype(np.uint64)
    codes = np.zeros(centers.shape[1], dtype=np.uint64)
    for axis, cell in enumerate(cells):
        for shift, mask in _SPREAD_STEPS:
            cell = (cell | (cell << np.uint64(shift))) & np.uint64(mask)
        codes |= cell << np.uint64(axis)
    return codes
