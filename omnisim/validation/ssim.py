"""Structural similarity of two images.

Source: Wang et al., "Image quality assessment: from error visibility to structural similarity",
2004, with its Gaussian window and constants.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from omnisim.core.srgb import srgb_from_linear

_SIGMA_PX, _REACH = 1.5, 3.5  # a window of 11 px
_C1, _C2 = 0.01**2, 0.03**2
_LUMA = np.array((0.299, 0.587, 0.114))


def ssim(
    first: NDArray[np.floating], second: NDArray[np.floating], mask: NDArray[np.bool_]
) -> float:
    """Mean structural similarity of the luma of two images (height, width, 3), linear RGB.

    Only pixels in the mask (height, width) count; all others are set to black.
    """
    one, other = (
        np.where(mask, srgb_from_linear(np.clip(values, 0.0, 1.0)) @ _LUMA, 0.0)
        for values in (first, second)
    )

    def mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return gaussian_filter(values, _SIGMA_PX, truncate=_REACH)

    mean_one, mean_other = mean(one), mean(other)
    variance_one, variance_other = mean(one**2) - mean_one**2, mean(other**2) - mean_other**2
    covariance = mean(one * other) - mean_one * mean_other
    levels = (2.0 * mean_one * mean_other + _C1) / (mean_one**2 + mean_other**2 + _C1)
    structure = (2.0 * covariance + _C2) / (variance_one + variance_other + _C2)
    return float((levels * structure)[mask].mean())
