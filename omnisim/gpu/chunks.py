"""Triangles in compact chunks: what is not seen is left out, chunk by chunk."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

# Triangles of a chunk. Fewer are culled more tightly, but each chunk is a draw of its own.
CHUNK = 128
# Triangles of about the same size are kept together: a wall would make the box of a chunk of
# screws as large as itself. Each class is so many times smaller than the one before.
SIZE_CLASS = 4.0
_BITS = 10  # of a Morton code, along each axis


class Chunks(NamedTuple):
    """Chunks of consecutive triangles.

    Attributes:
        first: (n,) first triangle.
        count: (n,) triangles.
        lows, highs: (n, 3) corners of the boxes around them.
        axes: (n, 3) unit, what their front sides face, on average.
        spreads: (n,) sine of the largest angle between the axis and one of their normals; above 1
            where that is a right angle or more.
    """

    first: NDArray[np.int64]
    count: NDArray[np.int64]
    lows: NDArray[np.float32]
    highs: NDArray[np.float32]
    axes: NDArray[np.float32]
    spreads: NDArray[np.float32]


NO_CHUNKS = Chunks(
    np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros((0, 3), dtype=np.float32),
    np.zeros((0, 3), dtype=np.float32), np.zeros((0, 3), dtype=np.float32),
    np.zeros(0, dtype=np.float32),
)  # fmt: skip


def chunked(corners: NDArray[np.float32]) -> tuple[NDArray[np.intp], Chunks]:
    """Cut triangles into chunks: near each other, about as large, facing about the same way.

    Args:
        corners: (n, 3, 3), a triangle's three in a row.

    Returns:
        The order (n,) in which the triangles follow each other, and the chunks in that order.
    """
    normals = unit_normals(corners)
    if len(corners) <= CHUNK:
        return np.arange(len(corners)), _cut(corners, normals, np.zeros(len(corners)))
    lows, highs = corners.min(axis=1), corners.max(axis=1)
    start, extent = lows.min(axis=0), max(float((highs.max(axis=0) - lows.min(axis=0)).max()), 1e-9)
    sizes = np.maximum((highs - lows).max(axis=1) / extent, 1e-6)
    size_class = np.floor(-np.log(sizes) / np.log(SIZE_CLASS)).astype(np.int64)
    axis = np.argmax(np.abs(normals), axis=1)
    side = 2 * axis + (np.take_along_axis(normals, axis[:, None], axis=1)[:, 0] > 0.0)
    cells = ((0.5 * (lows + highs) - start) * ((1 << _BITS) - 1) / extent).astype(np.uint64)
    group = 6 * size_class + side
    order = np.lexsort((_morton(cells), group))
    return order, _cut(corners[order], normals[order], group[order])


def _cut(
    corners: NDArray[np.float32], normals: NDArray[np.float32], groups: NDArray[np.int64]
) -> Chunks:
    """Chunks of at most `CHUNK` triangles of one group each, as they follow each other."""
    begins = np.flatnonzero(np.diff(groups, prepend=-1))
    sizes = np.diff(begins, append=len(groups))
    first = np.concatenate(
        [np.arange(begin, begin + size, CHUNK) for begin, size in zip(begins, sizes, strict=True)]
    )
    count = np.diff(first, append=len(corners))
    lows = np.minimum.reduceat(corners.min(axis=1), first)
    highs = np.maximum.reduceat(corners.max(axis=1), first)
    axes = np.add.reduceat(normals, first)
    axes /= np.maximum(np.linalg.norm(axes, axis=1, keepdims=True), 1e-30)
    cosines = np.sum(normals * np.repeat(axes, count, axis=0), axis=1)
    cosines[~normals.any(axis=1)] = 1.0  # a triangle without an area is not drawn
    least = np.minimum.reduceat(cosines, first)
    spreads = np.where(least > 0.0, np.sqrt(np.maximum(1.0 - least**2, 0.0)), 2.0)
    return Chunks(first, count, lows, highs, axes, spreads.astype(np.float32))


def joined(parts: list[Chunks]) -> Chunks:
    """The chunks of triangles that follow each other, part by part."""
    ends = np.cumsum([0] + [int(part.count.sum()) for part in parts])
    moved = [part._replace(first=part.first + end) for part, end in zip(parts, ends, strict=False)]
    return Chunks(*(np.concatenate(values) for values in zip(*moved, strict=True)))


def unit_normals(corners: NDArray[np.float32]) -> NDArray[np.float32]:
    """Normals (n, 3) of triangles, to the side from which they turn counter-clockwise; zero
    where there is no area."""  # fmt: skip
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return normals / np.where(lengths > 0.0, lengths, 1.0)


def _morton(cells: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """One number for each cell (n, 3) of `_BITS` bits along each axis: near cells, near numbers."""
    code = np.zeros(len(cells), dtype=np.uint64)
    for bit in range(_BITS):
        for axis in range(3):
            code |= ((cells[:, axis] >> np.uint64(bit)) & np.uint64(1)) << np.uint64(3 * bit + axis)
    return code
