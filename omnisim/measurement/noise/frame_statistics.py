"""Statistics of frames of an unchanged scene: means and temporal variances.

Source: EMVA Standard 1288, release 4.0, linear camera model: temporal variance from frame
differences, corrected for drift of the light between frames.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Floats
from omnisim.core.errors import MeasurementError
from omnisim.measurement.inputs import RAW_SUFFIXES, is_lossy, read_mosaic

MIN_FRAMES = 2  # one difference


@dataclass(frozen=True, eq=False)
class FrameStatistics:
    """Statistics of the frames at one exposure."""

    # name, count: folder of the frames, for messages, and their number
    name: str
    exposure_s: float
    count: int
    mean_image_dn: Floats  # (height, width) mean of the frames
    variance_dn2: float  # temporal variance, mean over the pixels, without the drift of the light
    # maximum_dn, clipped: largest value in any frame, and share of the values that equal it
    maximum_dn: float
    clipped: float
    zeros: float  # share of values that are 0
    bits: int  # bitwise OR of all values

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
    """Statistics of two or more frames (height, width) of unsigned integers, taken at one exposure.

    Only one frame is in memory at a time.

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
    variance_dn2 = max(float(spread.mean()) - drift, 0.0)
    shares = clipped / (count * total.size), zeros / (count * total.size)
    return FrameStatistics(
        name, exposure_s, count, total / count, variance_dn2, float(largest), *shares, bits
    )


# Folders of dark frames and flat fields, by exposure.
#
# A folder `dark` and a folder `flat`, each with a folder per exposure that is named by its time:
#
#     dark/1ms/*.png    flat/1ms/*.png    flat/2.5ms/*.png    flat/0.01s-bright/*.png


SUFFIXES = (".png", ".tif", ".tiff", ".pgm")
_UNITS_S = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6}
_EXPOSURE = re.compile(r"(\d+(?:\.\d+)?)\s*(s|ms|us|µs)(?:[-_ ].*)?")


@dataclass(frozen=True)
class FrameSet:
    """Image files of one exposure in a folder, sorted by name."""

    folder: Path
    exposure_s: float
    files: tuple[Path, ...]


def find_frame_sets(folder: Path, is_lossy_allowed: bool = False) -> list[FrameSet]:
    """Find the frames of a folder with one folder per exposure, such as `2.5ms` or `1ms-bright`.

    JPEG and WebP, which preserve mean values but not noise, have to be allowed.

    Raises:
        MeasurementError: the folder is missing or empty, a folder is not named by an exposure
            time, or a file is lossy or of an unknown format.
    """
    if not folder.is_dir():
        raise MeasurementError(f"{folder}: expected a folder with one folder per exposure")
    sets = []
    for inner in (path for path in sorted(folder.iterdir()) if path.is_dir()):
        match = _EXPOSURE.fullmatch(inner.name)
        if match is None:
            raise MeasurementError(f"{inner}: expected an exposure time as name, such as 2.5ms")
        files = tuple(path for path in sorted(inner.iterdir()) if not path.name.startswith("."))
        for path in files:
            if is_lossy(path) and not is_lossy_allowed:
                raise MeasurementError(
                    f"{path}: lossy compression changes the noise: save PNG or TIFF"
                )
            if not is_lossy(path) and path.suffix.lower() not in SUFFIXES + RAW_SUFFIXES:
                expected = " ".join(SUFFIXES)
                raise MeasurementError(f"{path}: expected images ({expected}) only")
        sets.append(FrameSet(inner, float(match[1]) * _UNITS_S[match[2]], files))
    if not sets:
        raise MeasurementError(f"{folder}: expected folders such as 1ms and 2.5ms, got none")
    return sorted(sets, key=lambda frames: frames.exposure_s)


def read_statistics(frames: FrameSet) -> FrameStatistics:
    """Statistics of the frames of one exposure.

    Raises:
        MeasurementError: a damaged file, a file that is not a raw image of one channel and 8 or 16
            bits, too few frames, or frames of several sizes.
    """

    def read() -> Iterator[NDArray[Any]]:
        for path in frames.files:
            pixels = read_mosaic(path)
            if pixels.dtype not in (np.uint8, np.uint16):
                raise MeasurementError(f"{path}: expected 8 or 16 bits, got {pixels.dtype}")
            if pixels.shape[2] != 1:
                raise MeasurementError(
                    f"{path}: expected raw frames of one channel, got {pixels.shape[2]}: "
                    "demosaicing mixes the noise of pixels"
                )
            yield pixels[..., 0]

    return frame_statistics(read(), frames.exposure_s, str(frames.folder))
