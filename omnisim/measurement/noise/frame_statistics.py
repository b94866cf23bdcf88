"""Statistics of frames of an unchanged scene: means and temporal variances.

Source: EMVA Standard 1288, release 4.0, linear camera model: temporal variance from frame
differences, corrected for drift of the light between frames.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import MeasurementError

MIN_FRAMES = 2  # one difference


@dataclass(frozen=True, eq=False)
class FrameStatistics:
    """Statistics of the frames at one exposure.

    Attributes:
        name: folder of the frames, for messages.
        exposure_s: exposure time.
        count: number of frames.
        mean_image_dn: (height, width) mean of the frames.
        variance_dn2: temporal variance, mean over the pixels, without the drift of the light.
        maximum_dn: largest value in any frame.
        clipped: share of values that equal `maximum_dn`.
        zeros: share of values that are 0.
        bits: bitwise OR of all values.
    """

    name: str
    exposure_s: float
    count: int
    mean_image_dn: NDArray[np.float64]
    variance_dn2: float
    maximum_dn: float
    clipped: float
    zeros: float
    bits: int

    @property
    def mean_dn(self) -> float:
        """Mean of all pixels."""
        return float(self.mean_image_dn.mean())

    @property
    def variance_sigma_dn2(self) -> float:
        """Standard deviation of `variance_dn2` for normal noise."""
        freedom = self.mean_image_dn.size * (self.count - 1)
        return float(self.variance_dn2 * np.sqrt(2.0 / freedom))

    def shifted(self, bits: int) -> FrameStatistics:
        """Statistics of the same values without their lowest `bits`, which are all 0."""
        scale = 2.0**-bits
        return dataclasses.replace(
            self,
            mean_image_dn=self.mean_image_dn * scale,
            variance_dn2=self.variance_dn2 * scale * scale,
            maximum_dn=self.maximum_dn * scale,
            bits=self.bits >> bits,
        )


def frame_statistics(
    frames: Iterable[NDArray[Any]], exposure_s: float, name: str = "frames"
) -> FrameStatistics:
    """Statistics of frames (height, width) of unsigned integers, taken at one exposure.

    Args:
        frames: at least two frames; only one is in memory at a time.
        exposure_s: exposure time of the frames.
        name: name of the frames, for messages.

    Raises:
        MeasurementError: fewer than two frames, or frames of several sizes.
    """
    total = squares = np.zeros((0, 0), dtype=np.int64)
    means: list[float] = []
    highest: list[tuple[int, int]] = []  # largest value of each frame, and its count
    zeros = bits = 0
    for number, frame in enumerate(frames):
        values = frame.astype(np.int64)
        if number == 0:
            total, squares = np.zeros_like(values), np.zeros_like(values)
        elif values.shape != total.shape:
            sizes = " and ".join(f"{shape[1]} × {shape[0]}" for shape in (total.shape, frame.shape))
            raise MeasurementError(f"{name}: expected frames of one size, got {sizes} px")
        total += values
        squares += values * values
        means.append(float(values.mean()))
        largest = int(values.max())
        highest.append((largest, int(np.count_nonzero(values == largest))))
        zeros += int(np.count_nonzero(values == 0))
        bits |= int(np.bitwise_or.reduce(values, axis=None))
    count = len(means)
    if count < MIN_FRAMES:
        raise MeasurementError(f"{name}: expected at least {MIN_FRAMES} frames, got {count}")
    largest = max(value for value, _ in highest)
    clipped = sum(number for value, number in highest if value == largest)
    # exact: sums of whole numbers
    spread = (count * squares - total * total) / (count * (count - 1))
    drift = float(np.var(means, ddof=1))
    return FrameStatistics(
        name=name,
        exposure_s=exposure_s,
        count=count,
        mean_image_dn=total / count,
        variance_dn2=max(float(spread.mean()) - drift, 0.0),
        maximum_dn=float(largest),
        clipped=clipped / (count * total.size),
        zeros=zeros / (count * total.size),
        bits=bits,
    )
