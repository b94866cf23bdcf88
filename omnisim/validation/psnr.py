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
    """PSNR of two linear RGB images (height, width, 3), compared as 8-bit sRGB.

    Only pixels in the mask (height, width) count. Equal images yield infinity; rounding to 8 bits
    limits the PSNR of nearly equal images to 56 dB.
    """
    one, other = (np.rint(255.0 * srgb_from_linear(values[mask])) for values in (first, second))
    return psnr_of_levels_db(one, other)


def psnr_of_levels_db(first: NDArray[Any], second: NDArray[Any]) -> float:
    """PSNR of two arrays of 8-bit levels (...), 0 to 255; infinite: all levels are equal."""
    error = float(np.mean((first.astype(np.float64) - second) ** 2))
    return math.inf if error == 0.0 else 10.0 * math.log10(255.0**2 / error)


def noise_floor_db(
    first: NDArray[np.floating], second: NDArray[np.floating], mask: NDArray[np.bool_]
) -> float:
    """PSNR between a sampled image and a perfect one, limited by the noise alone.

    `first` and `second` are linear RGB images sampled with different seeds. They differ by the
    noise of both: twice the variance of one image, so their PSNR is 3 dB lower.
    """
    return psnr_db(first, second, mask) + 10.0 * math.log10(2.0)


def converged_psnr_db(
    image: NDArray[np.floating],
    first: NDArray[np.floating],
    second: NDArray[np.floating],
    mask: NDArray[np.bool_],
) -> float:
    """PSNR to a converged image, estimated from two images with independent noise.

    The mean product of the differences from both has the expectation of the squared error to the
    converged image: the noise averages out. All images are linear RGB (height, width, 3), compared
    as sRGB; only pixels in the mask (height, width) count.
    """
    level, one, other = (srgb_from_linear(values[mask]) for values in (image, first, second))
    error = float(np.mean((level - one) * (level - other)))
    return math.inf if error <= 0.0 else -10.0 * math.log10(error)
