"""How far two pictures are apart, and how much of it is noise."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from omnisim.srgb import srgb_from_linear


def psnr_db(
    first: NDArray[np.floating], second: NDArray[np.floating], where: NDArray[np.bool_]
) -> float:
    """Peak signal-to-noise ratio of two pictures (height, width, 3), linear RGB, as 8-bit sRGB.

    Only pixels `where` (height, width) count. Infinite where they are equal; rounding alone
    leaves 56 dB between pictures that are merely almost so.
    """
    levels = [np.rint(255.0 * srgb_from_linear(picture[where])) for picture in (first, second)]
    error = float(np.mean((levels[0] - levels[1]) ** 2))
    return math.inf if error == 0.0 else 10.0 * math.log10(255.0**2 / error)


def noise_floor_db(
    first: NDArray[np.floating], second: NDArray[np.floating], where: NDArray[np.bool_]
) -> float:
    """PSNR that its noise alone leaves between a sampled picture and a perfect one.

    Two pictures sampled with different seeds differ by the noise of both: twice the variance of
    either, 3 dB.
    """
    return psnr_db(first, second, where) + 10.0 * math.log10(2.0)
