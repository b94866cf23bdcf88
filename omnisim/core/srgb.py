"""sRGB transfer function (IEC 61966-2-1), the reference for `shaders/common/srgb.glsl`."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from omnisim.core.arrays import Bytes, Floats, Floats32


def srgb_from_linear(linear: ArrayLike) -> Floats:
    """Encode linear values (...) in [0, 1]."""
    values = np.clip(np.asarray(linear, dtype=np.float64), 0.0, 1.0)
    high = 1.055 * np.maximum(values, 0.0031308) ** (1.0 / 2.4) - 0.055
    return np.where(values <= 0.0031308, 12.92 * values, high)


def linear_from_srgb(encoded: ArrayLike) -> Floats:
    """Decode sRGB values (...) in [0, 1]."""
    values = np.clip(np.asarray(encoded, dtype=np.float64), 0.0, 1.0)
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


LINEAR_FROM_SRGB8 = linear_from_srgb(np.arange(256) / 255.0)
_LINEAR_F4 = LINEAR_FROM_SRGB8.astype(np.float32)


def srgb8_from_linear(linear: ArrayLike) -> Bytes:
    """Encode linear values (...) in [0, 1] as 8 bits."""
    return np.rint(255.0 * srgb_from_linear(linear)).astype(np.uint8)


def linear_from_srgb8(encoded: NDArray[Any]) -> Floats32:
    """Decode 8-bit sRGB values (...)."""
    return _LINEAR_F4[encoded]
