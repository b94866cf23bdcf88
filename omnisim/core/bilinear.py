"""Bilinear interpolation between pixels."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from omnisim.core.arrays import Bools, Floats, Floats32, Indices


def corner_and_weights(
    positions_px: NDArray[np.floating[Any]], shape: tuple[int, int]
) -> tuple[Indices, Floats32, Bools]:
    """Upper-left neighbor of each position, and the weights of its four neighbors.

    Args:
        positions_px: (..., 2), u right and v down.
        shape: height and width of the image.

    Returns:
        Flat index (...) into the image, weights (4, ...), and a mask (...) that is True if all four
        neighbors are in the image.
    """
    height, width = shape
    last = (width - 1, height - 1)
    # rounding must not cut off the border in a view of the image itself
    inside = np.all((positions_px >= -1e-6) & (positions_px <= np.add(last, 1e-6)), axis=-1)
    safe = np.clip(np.where(inside[..., None], positions_px, 0.0), 0.0, last)
    first = np.minimum(np.floor(safe), (max(width - 2, 0), max(height - 2, 0))).astype(np.intp)
    right, down = np.moveaxis(safe - first, -1, 0)
    weights = np.stack(
        ((1 - right) * (1 - down), right * (1 - down), (1 - right) * down, right * down)
    )
    return first[..., 1] * width + first[..., 0], weights.astype(np.float32), inside


def interpolate(image: NDArray[Any], corner: Indices, weights: Floats32) -> Floats:
    """Interpolate an image (height, width) to values (...), see `corner_and_weights`."""
    flat, width = image.reshape(-1), image.shape[1]
    values = np.zeros(corner.shape)
    for step, weight in zip((0, 1, width, width + 1), weights, strict=True):
        values += weight * flat.take(corner + step, mode="clip")
    return values


def sample(image: NDArray[Any], positions_px: ArrayLike) -> Floats:
    """Sample an image (height, width) at positions (..., 2), u right and v down.

    Positions outside get the value of the nearest border pixel.
    """
    height, width = image.shape
    positions = np.clip(np.asarray(positions_px, dtype=np.float64), 0.0, (width - 1, height - 1))
    corner, weights, _ = corner_and_weights(positions, (height, width))
    return interpolate(image, corner, weights)
