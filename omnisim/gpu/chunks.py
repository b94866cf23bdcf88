"""Triangles in compact chunks: what is not seen is left out, chunk by chunk."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

# Triangles of a chunk. Fewer are culled more tightly, but each chunk has to be looked at.
CHUNK = 64
# A wall would make the box of a chunk of screws as large as itself: triangles larger than this
# share of all that is cut are kept apart.
LARGE = 1.0 / 8.0
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
        widths: (n,) side of a square as large as one of their triangles, on average.
    """

    first: NDArray[np.int64]
    count: NDArray[np.int64]
    lows: NDArray[np.float32]
    highs: NDArray[np.float32]
    axes: NDArray[np.float32]
    spreads: NDArray[np.float32]
    widths: NDArray[np.float32]


def compact_order(corners: NDArray[np.float32]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Order in which near triangles follow each other, and where to cut them into chunks.

    Args:
        corners: (n, 3, 3), a triangle's three in a row.

    Returns:
        The order (n,), and the first triangle of each chunk, counted in that order.
    """
    if len(corners) <= CHUNK:
        return np.arange(len(corners)), np.zeros(1, dtype=np.intp)
    lows, highs = corners.min(axis=1), corners.max(axis=1)
    start, extent = lows.min(axis=0), max(float((highs.max(axis=0) - lows.min(axis=0)).max()), 1e-9)
    is_large = (highs - lows).max(axis=1) > LARGE * extent
    cells = ((0.5 * (lows + highs) - start) * ((1 << _BITS) - 1) / extent).astype(np.uint64)
    small = len(corners) - int(is_large.sum())
    cuts = np.concatenate((np.arange(0, small, CHUNK), np.arange(small, len(corners), CHUNK)))
    return np.lexsort((_morton(cells), is_large)), cuts


def chunks_of(corners: NDArray[np.float32], first: NDArray[np.intp]) -> Chunks:
    """Chunks of triangles as they follow each other.

    Args:
        corners: (n, 3, 3), a triangle's three in a row.
        first: (m,) first triangle of each chunk.
    """
    count = np.diff(first, append=len(corners))
    lows = np.minimum.reduceat(corners.min(axis=1), first)
    highs = np.maximum.reduceat(corners.max(axis=1), first)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals /= np.where(lengths > 0.0, lengths, 1.0)
    axes = np.add.reduceat(normals, first)
    axes /= np.maximum(np.linalg.norm(axes, axis=1, keepdims=True), 1e-30)
    cosines = np.sum(normals * np.repeat(axes, count, axis=0), axis=1)
    cosines[lengths[:, 0] == 0.0] = 1.0  # a triangle without an area is not drawn
    least = np.minimum.reduceat(cosines, first)
    spreads = np.where(least > 0.0, np.sqrt(np.maximum(1.0 - least**2, 0.0)), 2.0)
    widths = np.sqrt(np.add.reduceat(0.5 * lengths[:, 0], first) / count)
    return Chunks(
        first, count, lows, highs, axes, spreads.astype(np.float32), widths.astype(np.float32)
    )


def _morton(cells: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """One number for each cell (n, 3) of `_BITS` bits along each axis: near cells, near numbers."""
    code = np.zeros(len(cells), dtype=np.uint64)
    for bit in range(_BITS):
        for axis in range(3):
            code |= ((cells[:, axis] >> np.uint64(bit)) & np.uint64(1)) << np.uint64(3 * bit + axis)
    return code
