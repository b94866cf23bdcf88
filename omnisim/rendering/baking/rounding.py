"""Rounding of light before storage: fewer digits make smaller files."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Bits kept of the largest value of a texel or probe, in half floats: the error is at most 1/256,
# which is less than half an 8-bit step of a bright pixel.
_BITS = 7
_MIN_HALF, _MAX_HALF = 1e-6, 65504.0


def rounded_halves(
    values: NDArray[np.floating], axes: int | tuple[int, ...]
) -> NDArray[np.float16]:
    """Round to steps set by the largest value along axes, as in shared-exponent colors.

    Args:
        values: linear light or factors of it, of any shape.
        axes: axes along which values share a step.
    """
    largest = np.abs(values).max(axis=axes, keepdims=True)
    steps = 2.0 ** (np.floor(np.log2(np.maximum(largest, _MIN_HALF))) - _BITS)
    rounded: NDArray[np.float16] = np.clip(
        np.round(values / steps) * steps, -_MAX_HALF, _MAX_HALF
    ).astype(np.float16)
    return rounded
