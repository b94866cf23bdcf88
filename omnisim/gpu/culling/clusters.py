"""Triangles in compact chunks, chunks in groups: what is not seen is left out, piece by piece."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.gpu.culling.spatial_clustering import spatial_order

# Most triangles of a chunk, how few are not worth two, and what is worth a cut otherwise, see
# `spatial_order`. Smaller chunks are culled more tightly, but each has to be looked at.
CHUNK, FEW_TRIANGLES, WORTH_A_CHUNK = 64, 4, 8.0
# Likewise, pieces of a group: where it is out of sight, they are not looked at. Groups are put into
# groups until there are so few of them, but not forever.
GROUP, FEW_PIECES, WORTH_A_GROUP = 32, 8, 8.0
FEW_GROUPS, MOST_LEVELS = 500, 3


class Clusters(NamedTuple):
    """Clusters of consecutive triangles.

    Attributes:
        first: (n,) first triangle.
        count: (n,) triangles.
        lows, highs: (n, 3) corners of the boxes around them.
        axes: (n, 3) unit, what their front sides face, on average.
        spreads: (n,) sine of the largest angle between the axis and one of their normals; above 1
            where that is a right angle or more.
        widths: (n,) side of a square as large as one of their triangles, on average; less where
            they are many: a wall of two hides more than a bush of twenty.
    """

    first: NDArray[np.int64]
    count: NDArray[np.int64]
    lows: NDArray[np.float32]
    highs: NDArray[np.float32]
    axes: NDArray[np.float32]
    spreads: NDArray[np.float32]
    widths: NDArray[np.float32]


class Groups(NamedTuple):
    """Groups of consecutive pieces, which are near each other and may look different.

    Attributes:
        first: (n,) first piece: a chunk, or a smaller group.
        count: (n,) pieces.
        triangles: (n,).
        lows, highs: (n, 3) corners of the boxes around them.
        widths: (n,) the largest of its chunks.
    """

    first: NDArray[np.int64]
    count: NDArray[np.int64]
    triangles: NDArray[np.int64]
    lows: NDArray[np.float32]
    highs: NDArray[np.float32]
    widths: NDArray[np.float32]


class Cut(NamedTuple):
    """Triangles, cut.

    Attributes:
        order: (n,) of the triangles, by chunk.
        chunks: by group.
        groups: those of chunks, then those of groups of chunks, ...; each ordered by the next.
    """

    order: NDArray[np.intp]
    chunks: Clusters
    groups: tuple[Groups, ...]


def cut(corners: NDArray[np.float32], looks: NDArray[np.integer]) -> Cut:
    """Cut triangles into chunks of one look each, and put these into groups.

    Args:
        corners: (n, 3, 3), a triangle's three in a row.
        looks: (n,) from 0.
    """
    order, first = spatial_order(_ends(corners), looks, FEW_TRIANGLES, CHUNK, WORTH_A_CHUNK)
    chunks = chunks_of(corners[order], first)
    counts = [chunks.count]
    numbers = np.arange(len(first))  # of the chunks, as they follow each other in the end
    around = np.concatenate((-chunks.lows.T, chunks.highs.T))
    # what is wide is drawn before what is not, and its groups are looked into before: others wait
    kinds = np.clip(np.frexp(chunks.widths)[1] // 2 + 8, 0, 16)
    for _ in range(MOST_LEVELS):
        total = len(first)
        pieces, first = spatial_order(around, kinds, FEW_PIECES, GROUP, WORTH_A_GROUP)
        around = np.maximum.reduceat(around[:, pieces], first, axis=1)
        kinds = np.zeros(len(first), dtype=np.int64)
        # what is below follows
        for level in reversed(range(len(counts))):
            count = counts[level]
            counts[level] = count[pieces]
            if level == 0:
                numbers = numbers[pieces]
            pieces = ranges(_firsts(count)[pieces], count[pieces])
        order = order[pieces]
        counts.append(np.diff(first, append=total))
        if len(first) <= FEW_GROUPS:
            break
    chunks = Clusters(_firsts(counts[0]), *(part[numbers] for part in chunks[1:]))
    groups: list[Groups] = []
    for count in counts[1:]:
        below, first = (groups[-1] if groups else chunks), _firsts(count)
        triangles = below.triangles if isinstance(below, Groups) else below.count
        groups.append(
            Groups(
                first, count, np.add.reduceat(triangles, first),
                np.minimum.reduceat(below.lows, first), np.maximum.reduceat(below.highs, first),
                np.maximum.reduceat(below.widths, first),
            )
        )  # fmt: skip
    return Cut(order, chunks, tuple(groups))


def _firsts(count: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.cumsum(count) - count


def ranges(first: NDArray[np.int64], count: NDArray[np.int64]) -> NDArray[np.int64]:
    """Consecutive numbers from each of `first` on, so many of each, all in one row."""
    numbers = np.repeat(first - _firsts(count), count)
    numbers += np.arange(len(numbers))
    return numbers


def chunks_of(corners: NDArray[np.float32], first: NDArray[np.intp]) -> Clusters:
    """Clusters of triangles as they follow each other.

    Args:
        corners: (n, 3, 3), a triangle's three in a row.
        first: (m,) first triangle of each chunk.
    """
    count = np.diff(first, append=len(corners))
    around = np.maximum.reduceat(_ends(corners), first, axis=1)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.sqrt(np.einsum("nc,nc->n", normals, normals))
    normals /= np.where(lengths > 0.0, lengths, 1.0)[:, None]
    axes = np.add.reduceat(normals, first)
    axes /= np.maximum(np.linalg.norm(axes, axis=1, keepdims=True), 1e-30)
    cosines = np.einsum("nc,nc->n", normals, np.repeat(axes, count, axis=0))
    cosines[lengths == 0.0] = 1.0  # a triangle without an area is not drawn
    least = np.minimum.reduceat(cosines, first)
    spreads = np.where(least > 0.0, np.sqrt(np.maximum(1.0 - least**2, 0.0)), 2.0)
    widths = np.sqrt(np.add.reduceat(0.5 * lengths, first) / count)
    widths *= np.minimum(FEW_TRIANGLES / count, 1.0) ** 0.25
    return Clusters(
        first, count, -around[:3].T, around[3:].T.copy(), axes,
        spreads.astype(np.float32), widths.astype(np.float32),
    )  # fmt: skip


def _ends(corners: NDArray[np.float32]) -> NDArray[np.float32]:
    """Low corners of the boxes around triangles times −1, then high ones: (6, n)."""
    one, two, three = np.moveaxis(corners, 1, 0)
    ends = np.empty((6, len(corners)), dtype=np.float32)
    np.negative(np.minimum(np.minimum(one, two), three).T, out=ends[:3])
    ends[3:] = np.maximum(np.maximum(one, two), three).T
    return ends
