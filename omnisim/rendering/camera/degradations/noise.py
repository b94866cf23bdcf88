"""Shot noise, dark current, fixed pattern, read noise and A/D conversion of a sensor.

The fixed pattern is each pixel's own gain and dark signal (PRNU, DSNU), equal in all images.

Without `gain_e_per_dn`, a full well gives the converter's largest number.

A linear value of 1 fills the well or gives the converter's largest number, whichever comes first:
`white_e` electrons. Caught photons are Poisson distributed. Below a mean of 32 electrons their
number is found by inversion of the distribution function, exact up to float32. From 32 on
it is λ + z√λ + (z² − 1)/6, rounded, z normal: the Cornish-Fisher expansion, which has
the first-order skewness of the Poisson distribution. The largest difference of the distribution
functions is 4e-4 there (12e-3 for a plain normal number), and shrinks with the mean; one step of
an 8-bit camera is many electrons by then.

Source: EMVA Standard 1288, release 4.0 (model and names); Cornish and Fisher, 1938.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from omnisim.core.arrays import Floats32, Uints32
from omnisim.core.errors import OutputError, SensorFileError
from omnisim.core.files.parameters import Fraction, LongSeed, Name, NotNegative, Positive, Typical
from omnisim.core.random_numbers import key_of, normal, pcg4d, uniform
from omnisim.rendering.camera.degradations.effect import DEFAULT_SHOT, SensorEffect, Shot
from omnisim.rendering.camera.degradations.image_geometry import (
    EffectStep,
    ImageGeometry,
    LinearImage,
)

NORMAL_FROM_E = 32.0  # mean number of electrons from which the normal approximation suffices
MAX_COUNTED = 128  # a mean below NORMAL_FROM_E gives no larger count
# From this term on, the sum's terms are below float32's steps near 1, and the sum has converged.
MIN_TERM = 2.0**-27
GAIN, OFFSET = "prnu", "dsnu_e"  # channels of a pattern's file


@dataclass(frozen=True, kw_only=True)
class Noise(SensorEffect, name="degradation.noise"):
    """Poisson-distributed electrons, fixed pattern and normal read noise, rounded and clipped.

    The result is scaled back to linear values in which white is 1. With a black level it may be
    below 0: clipping would brighten dark regions. Outside of the mask there is no noise.
    """

    full_well_e: Annotated[
        Positive, Field(ge=10.0, le=1e7), Typical(5_000.0, 30_000.0, "small CMOS", "large CCD")
    ] = 20_000.0
    """Full-well capacity in electrons."""
    gain_e_per_dn: Positive | None = None
    """Electrons per step of the converter; left out: a full well gives the largest number."""
    read_noise_e: Annotated[NotNegative, Typical(2.0, 20.0, "good CMOS", "interline CCD")] = 5.0
    """Standard deviation in electrons."""
    dark_current_e_per_s: Annotated[NotNegative, Typical(1.0, 100.0)] = 0.0
    """Dark current in electrons per second; needs shutter.exposure_s."""
    black_level_dn: NotNegative = 0.0
    """Steps added before the converter and subtracted after; typically 0.1 to 2 % of its range."""
    bit_depth: Annotated[int, Field(strict=True, ge=1, le=16), Typical(8.0, 14.0)] = 12
    """Bits of the converter."""
    prnu: Annotated[Fraction, Typical(0.003, 0.02)] = 0.0
    """Photo-response nonuniformity: standard deviation of the pixels' gains as a share of the
    mean."""
    dsnu_e: Annotated[NotNegative, Typical(0.5, 10.0)] = 0.0
    """Dark-signal nonuniformity: standard deviation of the pixels' dark signals in electrons."""
    pattern_seed: LongSeed = 0
    """Seed of the pixels' gains and dark signals."""
    pattern: Name | None = None
    """Measured pattern instead of prnu and dsnu_e: an EXR file beside this one. Its channels are
    prnu, each pixel's deviation from the mean gain as a share, and dsnu_e, in electrons."""

    files: ClassVar[tuple[str, ...]] = ("pattern",)

    def _check(self) -> None:
        if self.pattern is not None and (self.prnu or self.dsnu_e):
            raise self._error("pattern", "none with prnu or dsnu_e")
        if self.pattern is not None:
            read_pattern(Path(self.pattern))  # its faults, before anything is rendered
        if self.black_level_dn >= self.largest_dn:
            raise self._error(
                "black_level_dn",
                f"less than {self.largest_dn}, the largest number of {self.bit_depth} bits",
            )

    @property
    def largest_dn(self) -> int:
        """The converter's largest number."""
        return (1 << self.bit_depth) - 1

    @property
    def gain(self) -> float:
        """Electrons per step of the converter."""
        if self.gain_e_per_dn is not None:
            return self.gain_e_per_dn
        return self.full_well_e / (self.largest_dn - self.black_level_dn)

    @property
    def white_e(self) -> float:
        """Electrons at a linear value of 1."""
        return min(self.full_well_e, self.gain * (self.largest_dn - self.black_level_dn))

    def steps(self, geometry: ImageGeometry, shot: Shot = DEFAULT_SHOT) -> list[EffectStep]:
        """One GPU pass."""
        uniforms = {
            "u_key": shot.noise_key,
            "u_white_e": self.white_e,
            "u_full_well_e": self.full_well_e,
            "u_gain_e_per_dn": self.gain,
            "u_read_noise_e": self.read_noise_e,
            "u_dark_e": self.dark_current_e_per_s * shot.exposure_s,
            "u_black_level_dn": self.black_level_dn,
            "u_largest_dn": float(self.largest_dn),
            "u_normal_from_e": NORMAL_FROM_E,
            "u_most_counted": MAX_COUNTED,
            "u_smallest_term": MIN_TERM,
        }
        return [EffectStep("noise", uniforms, {"u_pattern": self._fixed_pattern(geometry)})]

    def apply(
        self, image: LinearImage, geometry: ImageGeometry, shot: Shot = DEFAULT_SHOT
    ) -> LinearImage:
        """Reference in NumPy."""
        column, row, channel = np.meshgrid(
            np.arange(geometry.width_px), np.arange(geometry.height_px), np.arange(3)
        )
        hashes = pcg4d(column, row, shot.frame_number, shot.noise_key + channel)
        dark_e = np.float32(self.dark_current_e_per_s * shot.exposure_s)
        white_e, gain = np.float32(self.white_e), np.float32(self.gain)
        black = np.float32(self.black_level_dn)
        pattern = self._fixed_pattern(geometry)
        light_e = np.maximum(image[..., :3], np.float32(0.0)) * white_e
        mean_e = light_e * (np.float32(1.0) + pattern[..., :1]) + dark_e
        electrons = np.minimum(poisson(mean_e, hashes[0], hashes[1]), np.float32(self.full_well_e))
        electrons += pattern[..., 1:]
        electrons += np.float32(self.read_noise_e) * normal(hashes[2], hashes[3])
        numbers = np.floor(electrons / gain + black + np.float32(0.5))
        numbers = np.clip(numbers, np.float32(0.0), np.float32(self.largest_dn))
        result = image.copy()
        seen = image[..., 3] > 0.5
        result[seen, :3] = ((numbers[seen] - black) * gain - dark_e) / white_e
        return result

    def _fixed_pattern(self, geometry: ImageGeometry) -> Floats32:
        """Pattern (height, width, 2), or (1, 1, 2) of a uniform sensor."""
        size = geometry.width_px, geometry.height_px
        if self.pattern is not None:
            return resampled(read_pattern(Path(self.pattern)), *size)
        if self.prnu == 0.0 and self.dsnu_e == 0.0:
            return np.zeros((1, 1, 2), dtype=np.float32)
        return random_pattern(*size, self.prnu, self.dsnu_e, self.pattern_seed)


def poisson(mean: Floats32, first: Uints32, second: Uints32) -> Floats32:
    """Poisson-distributed integers (...) with means (...) ≥ 0, from two hashes each."""
    z = normal(first, second)
    large = np.maximum(mean, np.float32(NORMAL_FROM_E))
    many = large + np.sqrt(large) * z + (z * z - np.float32(1.0)) * np.float32(1.0 / 6.0)
    counts = np.maximum(np.floor(many + np.float32(0.5)), np.float32(0.0))
    few = mean < np.float32(NORMAL_FROM_E)
    counts[few] = _quantiles(mean[few], uniform(first[few]))
    return counts


def _quantiles(mean: Floats32, fraction: Floats32) -> Floats32:
    """Quantiles (n,) of the Poisson distribution with means (n,), by summation."""
    term = np.exp(-mean)
    total = term.copy()
    count = np.zeros_like(mean)
    for number in range(1, MAX_COUNTED):
        more = (fraction > total) & ~((number > mean) & (term < np.float32(MIN_TERM)))
        if not np.any(more):
            break
        term = np.where(more, term * (mean / np.float32(number)), term)
        total = np.where(more, total + term, total)
        count = np.where(more, np.float32(number), count)
    return count


def random_pattern(
    width_px: int, height_px: int, prnu: float, dsnu_e: float, seed: int
) -> Floats32:
    """Normally distributed pattern without rows or columns.

    Args:
        prnu: standard deviation of the pixels' gains, as a share of the mean gain.
        dsnu_e: standard deviation of the pixels' dark signals, electrons.
        seed: seed of the pattern.

    Returns:
        (height, width, 2): deviation of the gain as a share, and of the dark signal in electrons.
    """
    column, row = np.meshgrid(np.arange(width_px), np.arange(height_px))
    hashes = pcg4d(column, row, 0, key_of("fixed pattern", seed))
    deviations = normal(hashes[0], hashes[1]), normal(hashes[2], hashes[3])
    sigmas = np.array((prnu, dsnu_e), dtype=np.float32)
    return np.stack(deviations, axis=-1) * sigmas


def write_pattern(path: Path, pattern: Floats32) -> None:
    """Write a pattern (height, width, 2) as an EXR file with the channels `prnu` and `dsnu_e`.

    Raises:
        OutputError: the file cannot be written.
    """
    from omnisim.core.files.image_files import write_channels  # slow to import

    write_channels(path, {GAIN: pattern[..., 0], OFFSET: pattern[..., 1]})


def read_pattern(path: Path) -> Floats32:
    """Pattern (height, width, 2) of a file, see `write_pattern`.

    Raises:
        SensorFileError: the file is damaged, or has other channels or numbers than expected.
    """
    try:
        changed_ns = path.stat().st_mtime_ns
    except OSError as reason:
        raise SensorFileError(f"{path}: cannot be read: {reason.strerror}") from None
    return _read(path, changed_ns)


@lru_cache(maxsize=2)  # the reference reads it for each image
def _read(path: Path, changed_ns: int) -> Floats32:
    from omnisim.core.files.image_files import read_channels  # slow to import

    try:
        channels = read_channels(path).values
    except OutputError as reason:
        raise SensorFileError(str(reason)) from None
    if sorted(channels) != sorted((GAIN, OFFSET)):
        expected = f"expected the channels {GAIN} and {OFFSET}"
        raise SensorFileError(f"{path}: {expected}, got {', '.join(sorted(channels))}")
    pattern = np.stack((channels[GAIN], channels[OFFSET]), axis=-1)
    if not np.isfinite(pattern).all() or (pattern[..., 0] < -1.0).any():
        raise SensorFileError(f"{path}: expected finite numbers, and {GAIN} of at least -1")
    pattern.setflags(write=False)
    return pattern


def resampled(pattern: Floats32, width_px: int, height_px: int) -> Floats32:
    """Pattern (height, width, 2) of an image of another size: that of the nearest pixels.

    Neighbors are not averaged, which would make the pattern weaker.
    """
    height, width = pattern.shape[:2]
    if (height, width) == (height_px, width_px):
        return pattern
    rows = (2 * np.arange(height_px) + 1) * height // (2 * height_px)
    columns = (2 * np.arange(width_px) + 1) * width // (2 * width_px)
    return pattern[rows[:, None], columns]
