"""Rasterization of triangles in an atlas: position of each texel part on a triangle."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

GRID = 2  # parts per texel side
_BATCH = 1 << 21  # candidates at once


class Samples(NamedTuple):
    """Points of surfaces, each in a texel.

    Attributes:
        texels: (n,) row · width + column in the atlas.
        triangles: (n,) int32 triangle indices.
        weights: (n, 3) float32 barycentric weights.
    """

    texels: NDArray[np.intp]
    triangles: NDArray[np.int32]
    weights: NDArray[np.float32]

    def take(self, indices: NDArray[np.intp]) -> Samples:
        """The selected samples."""
        return Samples(self.texels[indices], self.triangles[indices], self.weights[indices])


def rasterize(
    corners_px: NDArray[np.float32], triangles: NDArray[np.intp], width_px: int
) -> Samples:
    """Samples of triangles on a grid of `GRID` × `GRID` in each texel.

    A slim triangle also has samples along its middle line, so that its whole length is covered.

    Args:
        corners_px: (m, 3, 2) corners of all triangles.
        triangles: (k,) indices of the triangles in the atlas.
        width_px: width of the atlas.
    """
    samples = [Samples(np.empty(0, np.intp), np.empty(0, np.int32), np.empty((0, 3), np.float32))]
    corners = corners_px[triangles].astype(np.float64) * GRID - 0.5
    low = np.ceil(corners.min(axis=1) - 1e-9).astype(np.intp)
    high = np.floor(corners.max(axis=1) + 1e-9).astype(np.intp)
    spans = np.maximum(high - low + 1, 0)
    ends = np.cumsum(spans.prod(axis=1))
    total = int(ends[-1]) if len(ends) else 0
    starts = np.searchsorted(ends, np.arange(0, max(total, 1), _BATCH))
    has_sample = np.zeros(len(triangles), dtype=np.bool_)
    for first, last in zip(starts, [*starts[1:], len(triangles)], strict=True):
        some = np.arange(first, last)
        if len(some) == 0:
            continue
        owner, points = _candidates(low[some], spans[some])
        inside, weights = _weights(corners[some][owner], points)
        owner = some[owner[inside]]
        has_sample[owner] = True
        texels = points[inside] // GRID
        samples.append(
            Samples(
                texels[:, 1] * width_px + texels[:, 0],
                triangles[owner].astype(np.int32),
                weights.astype(np.float32),
            )
        )
    samples.append(_slim_samples(corners_px, triangles, has_sample, width_px))
    return Samples(*(np.concatenate(parts) for parts in zip(*samples, strict=True)))


def _slim_samples(
    corners_px: NDArray[np.float32],
    triangles: NDArray[np.intp],
    has_sample: NDArray[np.bool_],
    width_px: int,
) -> Samples:
    """Samples of slim triangles, from a corner to the middle of the shortest edge."""
    corners = corners_px[triangles].astype(np.float64)
    edges = np.roll(corners, -1, axis=1) - np.roll(corners, -2, axis=1)  # opposite to each corner
    lengths = np.linalg.norm(edges, axis=2)
    area = np.abs(_cross(edges[:, 0], edges[:, 1]))
    is_slim = ~has_sample | (area < lengths.max(axis=1))
    slim = np.flatnonzero(is_slim)
    apex = lengths[slim].argmin(axis=1)
    counts = np.ceil(GRID * lengths[slim].max(axis=1)).astype(np.intp) + 1
    owner = np.repeat(np.arange(len(slim)), counts)
    within = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    away = (within + 0.5) / counts[owner]
    weights = np.repeat(0.5 * away[:, None], 3, axis=1)
    weights[np.arange(len(owner)), apex[owner]] = 1.0 - away
    points = np.floor(np.einsum("nk,nkc->nc", weights, corners[slim[owner]])).astype(np.intp)
    return Samples(
        points[:, 1] * width_px + points[:, 0],
        triangles[slim[owner]].astype(np.int32),
        weights.astype(np.float32),
    )


def _candidates(
    low: NDArray[np.intp], spans: NDArray[np.intp]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Triangles (n,) and grid points (n, 2) within the triangles' bounds."""
    counts = spans.prod(axis=1)
    owner = np.repeat(np.arange(len(low)), counts)
    within = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    wide = spans[owner, 0]
    return owner, low[owner] + np.stack((within % wide, within // wide), axis=1)


def _weights(
    corners: NDArray[np.float64], points: NDArray[np.intp]
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Indices of the points (n, 2) inside their triangles (n, 3, 2), and barycentric weights."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    area = _cross(b - a, c - a)
    second, third = _cross(points - a, c - a), _cross(b - a, points - a)
    with np.errstate(divide="ignore", invalid="ignore"):
        weights = np.stack((second, third), axis=1) / area[:, None]
        first = 1.0 - weights.sum(axis=1)
        inside = np.flatnonzero((weights.min(axis=1) >= -1e-9) & (first >= -1e-9))
    return inside, np.column_stack((first[inside], weights[inside]))


def _cross(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    product: NDArray[np.float64] = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
    return product
