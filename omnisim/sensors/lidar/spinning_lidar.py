"""Spinning 3-D lidars: rings, revolution, limits and noise. By default a Velodyne VLP-16.

Frame of the lidar: x forward, y left, z up (REP 103); all lasers start at its origin, and ring 0
looks down the most, as the drivers of ROS count. The head turns clockwise seen from above, as
Velodyne's do, and a revolution begins straight behind. All rings of a firing shoot at once, in one
direction; a laser has one return. The devices' lasers shoot within 46 µs, their lenses lie some
centimeters apart, and a beam that two surfaces share has two returns: all this is left out.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from omnisim.core.errors import OpticsError
from omnisim.core.files.parameters import NotNegative, Number, Parameters, Positive
from omnisim.core.short_repr import short_repr
from omnisim.ground_truth.lidar_beams import LidarBeams
from omnisim.sensors.laser_scanner.laser_scanner import MAX_SEED

MAX_RINGS, MAX_FIRINGS = 1024, 16384
MAX_ELEVATION_DEG = 80.0
VLP16_ELEVATIONS_DEG = tuple(-15.0 + 2.0 * ring for ring in range(16))
HDL64E_ELEVATIONS_DEG = (
    *(-24.33 + 0.5 * ring for ring in range(32)),  # lower block: −24.33° to −8.83°
    *(-25.0 / 3.0 + ring / 3.0 for ring in range(32)),  # upper block: −8.33° to 2°
)

Elevation = Annotated[Number, Field(ge=-MAX_ELEVATION_DEG, le=MAX_ELEVATION_DEG)]


@dataclass(frozen=True, kw_only=True)
class SpinningLidar(Parameters, name="lidar"):
    """Rings and range model of a lidar. Without arguments: a VLP-16 at 10 revolutions a second.

    Attributes:
        elevations_deg: of the rings, rising.
        firings: in a revolution, evenly spaced.
        rate_hz: revolutions a second.
        range_min_m, range_max_m: nearer and farther hits give no point.
        step_m: ranges are rounded to multiples of it; 0: not at all.
        sigma_m: standard deviation of a range, normally distributed.
        seed: of the device: all its noise.

    Raises:
        OpticsError: naming the parameter, what was expected and what was got.
    """

    elevations_deg: Annotated[tuple[Elevation, ...], Field(min_length=1, max_length=MAX_RINGS)] = (
        VLP16_ELEVATIONS_DEG
    )
    firings: Annotated[int, Field(strict=True, ge=8, le=MAX_FIRINGS)] = 1800
    rate_hz: Annotated[Number, Field(ge=0.01, le=1000.0)] = 10.0
    range_min_m: NotNegative = 0.5
    range_max_m: Positive = 100.0
    step_m: NotNegative = 0.002
    sigma_m: NotNegative = 0.03
    seed: Annotated[int, Field(strict=True, ge=0, le=MAX_SEED)] = 0

    def __repr__(self) -> str:
        rings = f"{self.rings} rings × {self.firings} firings at {self.rate_hz:g} Hz"
        return short_repr(self, rings, f"{self.range_min_m:g} to {self.range_max_m:g} m")

    def _check(self) -> None:
        if any(np.diff(self.elevations_deg) <= 0.0):
            raise self._error("elevations_deg", "rising angles")
        if self.range_min_m >= self.range_max_m:
            raise self._error("range_min_m", f"less than range_max_m = {self.range_max_m:g}")

    @classmethod
    def vlp16(cls) -> SpinningLidar:
        """A Velodyne VLP-16 at 10 Hz.

        Source: Velodyne, VLP-16 User Manual, 63-9243 Rev. D: 16 lasers 2° apart, 0.2° at 10 Hz,
        100 m, steps of 2 mm. Its typical accuracy of ±3 cm is taken as the standard deviation, and
        the least range is assumed.
        """
        return cls()

    @classmethod
    def hdl64e(cls) -> SpinningLidar:
        """A Velodyne HDL-64E S2 at 10 Hz.

        Source: Velodyne, HDL-64E S2 User's Manual, specifications: 32 lasers 1/3° apart above 32
        that are 1/2° apart, 120 m, less than 2 cm (one sigma), steps of 2 mm. 2083 firings are
        0.173° apart. Numbers that could not be checked are assumed, the least range above all.
        """
        return cls(
            elevations_deg=HDL64E_ELEVATIONS_DEG,
            firings=2083,
            range_min_m=0.9,
            range_max_m=120.0,
            sigma_m=0.02,
        )

    def without_noise(self) -> SpinningLidar:
        """The same lidar without noise; it still rounds."""
        return dataclasses.replace(self, sigma_m=0.0)

    def without_errors(self) -> SpinningLidar:
        """The same lidar without noise and without rounding."""
        return dataclasses.replace(self.without_noise(), step_m=0.0)

    @property
    def rings(self) -> int:
        """Number of rings."""
        return len(self.elevations_deg)

    @property
    def period_s(self) -> float:
        """Seconds of a revolution."""
        return 1.0 / self.rate_hz

    @property
    def reach_m(self) -> float:
        """Range beyond which no noise brings a surface back into range."""
        return self.range_max_m + self.step_m + 10.0 * self.sigma_m  # once in 1e23 points

    @cached_property
    def azimuths_rad(self) -> NDArray[np.float64]:
        """Azimuths (firings,) from straight ahead, counter-clockwise: from π downwards."""
        return math.pi - 2.0 * math.pi * np.arange(self.firings, dtype=np.float64) / self.firings

    @cached_property
    def times_s(self) -> NDArray[np.float64]:
        """Times (firings,) of the firings, from the revolution's start."""
        return np.arange(self.firings, dtype=np.float64) * (self.period_s / self.firings)

    @cached_property
    def beams(self) -> LidarBeams:
        """Directions of its beams."""
        return LidarBeams(np.radians(self.elevations_deg), self.azimuths_rad, self.reach_m)

    def measure(self, true_ranges_m: NDArray[np.floating], revolution: int) -> NDArray[np.float64]:
        """Measured ranges (rings, firings) in meters; +inf: no return.

        The noise depends on the seed, the number of the revolution, ring and firing alone, so that
        any revolution of a drive can be made again by itself.

        Args:
            true_ranges_m: (rings, firings), +inf where nothing is hit.
            revolution: its number; those with the same number have the same noise.

        Raises:
            OpticsError: a number that is not a whole number of 32 bits.
        """
        is_whole = isinstance(revolution, int | np.integer) and not isinstance(revolution, bool)
        if not (is_whole and 0 <= revolution <= MAX_SEED):
            raise OpticsError(
                f"lidar: revolution: expected a whole number of 32 bits, got {revolution!r}"
            )
        ranges_m = np.array(true_ranges_m, dtype=np.float64)
        if self.sigma_m:
            random = np.random.default_rng((self.seed, revolution))
            ranges_m += self.sigma_m * random.standard_normal(ranges_m.shape)
        if self.step_m:
            steps_a_meter = 1.0 / self.step_m
            ranges_m = np.rint(ranges_m * steps_a_meter) / steps_a_meter
        ranges_m[(ranges_m < self.range_min_m) | (ranges_m > self.range_max_m)] = np.inf
        return ranges_m
