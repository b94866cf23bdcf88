"""Parts of triangles that are small compared with the cells of a floor plan."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from omnisim.core.bounds import triangle_bounds

MIN_UP = 0.5  # cosine of the maximum slope of floor: 60°
EDGE = 1e-9  # share of a triangle: a point on a common edge is in at least one triangle


def is_flat(corners_m: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Mask (n,) of triangles (n, 3, 3) with a slope below 60°, whichever side is up."""
    normals = np.cross(corners_m[:, 1] - corners_m[:, 0], corners_m[:, 2] - corners_m[:, 0])
    flat: NDArray[np.bool_] = np.abs(normals[:, 2]) > MIN_UP * np.linalg.norm(normals, axis=1)
    return flat


def heights_in(
    corners_m: NDArray[np.float64], points_m: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Heights (...,) of a triangle (3, 3) at points (..., 2) of the floor plan; NaN outside it."""
    a, b, c = corners_m
    matrix = np.column_stack((a[:2] - c[:2], b[:2] - c[:2]))
    first, second = np.moveaxis((points_m - c[:2]) @ np.linalg.inv(matrix).T, -1, 0)
    third = 1.0 - first - second
    inside = np.minimum(np.minimum(first, second), third) >= -EDGE
    return np.where(inside, first * a[2] + second * b[2] + third * c[2], np.nan)


def surface_points(
    corners_m: NDArray[np.float64],
    spacing_m: float,
    band_m: tuple[float, float] = (-np.inf, np.inf),
) -> Iterator[NDArray[np.float64]]:
    """Points (n, 3) on triangles (m, 3, 3) within a band of heights, in batches.

    Triangles are halved across their longest edge until it is at most `spacing_m` long. Each point
    of a triangle is then within `spacing_m` of a returned point.

    Args:
        corners_m: (m, 3, 3) corners of the triangles.
        spacing_m: maximum edge length of a part.
        band_m: lowest and highest height; triangles beyond it are skipped.
    """
    while len(corners_m):
        low, high = triangle_bounds(corners_m[..., 2])
        corners_m = corners_m[(high >= band_m[0]) & (low <= band_m[1])]
        short, corners_m = _halved(corners_m, spacing_m)
        yield short.mean(axis=1)


def columns_of(
    corners_m: NDArray[np.float64],
    spacing_m: float,
    low_m: NDArray[np.float64],
    high_m: NDArray[np.float64],
) -> Iterator[NDArray[np.float64]]:
    """Parts (n, 3, 3) of triangles in a box, in batches; each is small on the floor plan.

    The height of a part is not limited.

    Args:
        corners_m: (m, 3, 3) corners of the triangles.
        spacing_m: maximum edge length of a part on the floor plan.
        low_m, high_m: (3,) opposite corners of the box; parts outside are excluded.
    """
    while len(corners_m):
        low, high = triangle_bounds(corners_m)
        near = np.all((high >= low_m) & (low <= high_m), axis=1)
        short, corners_m = _halved(corners_m[near], spacing_m, axes=2)
        yield short


def _halved(
    corners_m: NDArray[np.float64], spacing_m: float, axes: int = 3
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Triangles with edges up to `spacing_m` along the first axes, and the halves of all others."""
    planned = corners_m[..., :axes]
    edges = planned[:, (1, 2, 0)] - planned
    squares = np.einsum("nij,nij->ni", edges, edges)
    longest = squares.argmax(axis=1)
    is_short = np.take_along_axis(squares, longest[:, None], 1)[:, 0] <= spacing_m**2
    rows, longest = np.flatnonzero(~is_short), longest[~is_short]
    first, second = corners_m[rows, longest], corners_m[rows, (longest + 1) % 3]
    third, middle = corners_m[rows, (longest + 2) % 3], 0.5 * (first + second)
    halves = np.empty((2 * len(rows), 3, 3))
    own, other = halves[: len(rows)], halves[len(rows) :]
    own[:, 0], own[:, 1], own[:, 2] = first, middle, third
    other[:, 0], other[:, 1], other[:, 2] = middle, second, third
    return corners_m[is_short], halves
