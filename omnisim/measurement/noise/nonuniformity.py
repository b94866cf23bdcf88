"""Fixed pattern of a sensor, from mean images of many dark frames and flat fields.

Source: EMVA Standard 1288, release 4.0, section 8: spatial variance split into row, column and
pixel variances, after subtracting the temporal noise that remains in a mean image.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnisim.measurement.noise.frame_statistics import FrameStatistics
from omnisim.measurement.noise.photon_transfer import DarkSignal

MIN_FRAMES = 16  # of a mean image; EMVA 1288 recommends more than 100
_TREND_DEGREE = 6  # of the polynomial that takes the light's and the lens's falloff
_DEFECT = 8.0  # robust standard deviations from the mean


@dataclass(frozen=True, eq=False)
class Nonuniformity:
    """Spatial variation of a mean image, temporal noise removed.

    Attributes:
        total, row, column, pixel: standard deviations: of all pixels, of the row means, of the
            column means, and of the rest.
        sigma: uncertainty of `total` (standard deviation).
        defects: (n, 2) row and column of pixels more than 8 standard deviations off the median.
        pattern: (height, width) deviations from the mean.
    """

    total: float
    row: float
    column: float
    pixel: float
    sigma: float
    defects: NDArray[np.int64]
    pattern: NDArray[np.float64]


def dark_nonuniformity(stack: FrameStatistics) -> Nonuniformity:
    """Nonuniformity of dark frames, in DN."""
    deviations = stack.mean_image_dn - stack.mean_dn
    return _nonuniformity(deviations, stack.variance_dn2 / stack.count)


def photo_response_nonuniformity(
    flat: FrameStatistics, stack: FrameStatistics, dark: DarkSignal, mosaic: bool
) -> Nonuniformity:
    """Nonuniformity of the response as a share of the mean response.

    Args:
        flat: flat field.
        stack: dark frames of the same sensor; their pattern is subtracted.
        dark: dark signal by exposure.
        mosaic: the frames have a Bayer mosaic; the mean of each of its four colors is subtracted.
    """
    offset = dark.mean_dn(flat.exposure_s) - stack.mean_dn
    signal = flat.mean_image_dn - stack.mean_image_dn - offset
    trend = np.empty_like(signal)
    step = 2 if mosaic else 1
    for row in range(step):
        for column in range(step):
            plane = np.s_[row::step, column::step]
            trend[plane] = _trend(signal[plane])
    response = signal / trend - 1.0
    temporal = flat.variance_dn2 / flat.count + stack.variance_dn2 / stack.count
    return _nonuniformity(response, temporal * float(np.mean(trend**-2)))


def _nonuniformity(deviations: NDArray[np.float64], temporal: float) -> Nonuniformity:
    """Nonuniformity of a mean image's deviations; `temporal` is the variance of its noise."""
    rows, columns = deviations.shape
    measured = float(deviations.var(ddof=1))
    of_rows = float(deviations.mean(axis=1).var(ddof=1)) - temporal / columns
    of_columns = float(deviations.mean(axis=0).var(ddof=1)) - temporal / rows
    total = measured - temporal
    # a mean over a row still has a share of the pixels' variance
    parts = np.linalg.solve(
        [[1.0, 1.0, 1.0], [1.0, 0.0, 1.0 / columns], [0.0, 1.0, 1.0 / rows]],
        [total, of_rows, of_columns],
    )
    row, column, pixel = np.sqrt(np.maximum(parts, 0.0)).tolist()
    spread = float(np.sqrt(max(total, 0.0)))
    variance_sigma = measured * np.sqrt(2.0 / (deviations.size - 1))
    sigma = variance_sigma / (2.0 * spread) if spread > 0.0 else np.sqrt(variance_sigma)
    middle = float(np.median(deviations))
    robust = 1.4826 * float(np.median(np.abs(deviations - middle)))
    is_defect = np.abs(deviations - middle) > _DEFECT * max(robust, np.sqrt(temporal))
    # noise widens the pattern: narrower by as much, it has the spread that was measured
    shrink = np.sqrt(max(total, 0.0) / measured) if measured > 0.0 else 0.0
    pattern = np.where(is_defect, deviations, deviations * shrink)
    return Nonuniformity(spread, row, column, pixel, float(sigma), np.argwhere(is_defect), pattern)


def _trend(signal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Polynomial of the image coordinates that best fits an image (height, width)."""
    x, y = (
        np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, size), _TREND_DEGREE)
        for size in signal.shape[::-1]
    )
    # on a grid, the best polynomial follows from its parts along rows and columns
    along_x, along_y = np.linalg.qr(x)[0], np.linalg.qr(y)[0]
    coefficients = along_y.T @ signal @ along_x
    orders = np.add.outer(np.arange(_TREND_DEGREE + 1), np.arange(_TREND_DEGREE + 1))
    coefficients[orders > _TREND_DEGREE] = 0.0
    trend: NDArray[np.float64] = along_y @ coefficients @ along_x.T
    return trend
