"""Peak signal-to-noise ratio of two images, and its noise floor."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.core.srgb import srgb_from_linear


def psnr_db(
    first: NDArray[np.floating], second: NDArray[np.floating], mask: NDArray[np.bool_]
) -> float:
    """Peak signal-to-noise ratio of two images (height, width, 3), linear RGB, as 8-bit sRGB.

    Only pixels in the mask (height, width) count. Infinite for equal images; rounding alone limits
    nearly equal ones to 56 dB.
    """
    one, other = (np.rint(255.0 * srgb_from_linear(values[mask])) for values in (first, second))
    return psnr_of_levels_db(one, other)


def psnr_of_levels_db(first: NDArray[Any], second: NDArray[Any]) -> float:
    """Peak signal-to-noise ratio of 8-bit levels (...), 0 to 255; infinite: all are equal."""
    error = float(np.mean((first.astype(np.float64) - second) ** 2))
    return math.inf if error == 0.0 else 10.0 * math.log10(255.0**2 / error)


def noise_floor_db(
    first: NDArray[np.floating], second: NDArray[np.floating], mask: NDArray[np.bool_]
) -> float:
    """PSNR between a sampled image and a perfect one, limited by the noise alone.

    Two images sampled with different seeds differ by the noise of both: twice the variance of
    either, or
    3 dB. either, 3 dB.
    """
    return psnr_db(first, second, mask) + 10.0 * math.log10(2.0)
