"""Rounding of light before it is stored: files of fewer digits are smaller."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Of the largest number of a texel or probe, in half floats: at most 1/256 of it is lost, which is
# less than half a step of a bright pixel's 8 bits.
_BITS = 7
_MIN_HALF, _MAX_HALF = 1e-6, 65504.0


def rounded_halves(
    values: NDArray[np.floating], axes: int | tuple[int, ...]
) -> NDArray[np.float16]:
    """Round to steps by the largest number along axes, like colors with a shared exponent.

    Args:
        values: of any shape, linear light or factors of it.
        axes: of the numbers that share their step.
    """
    largest = np.abs(values).max(axis=axes, keepdims=True)
    steps = 2.0 ** (np.floor(np.log2(np.maximum(largest, _MIN_HALF))) - _BITS)
    rounded: NDArray[np.float16] = np.clip(
        np.round(values / steps) * steps, -_MAX_HALF, _MAX_HALF
    ).astype(np.float16)
    return rounded
