"""Laser range scanners: beams, limits and errors. By default a SICK LMS200.

Frame of the scanner: x forward, y left, z up (REP 103); the beams lie in its plane z = 0 and start
at its origin. They count from right to left, counter-clockwise seen from above, as ROS's LaserScan
and USARSim do.
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

LMS200_MODES = {"mm": (8.19, 0.001), "cm": (81.9, 0.01)}  # range_max_m and step_m: 13 bits
_LMS200_FIELDS_DEG = {1.0: 180.0, 0.5: 180.0, 0.25: 100.0}  # by resolution
MAX_BEAMS = 100_000
MAX_SEED = 2**32 - 1  # one word of NumPy's seeds each, so that no two runs of words are alike
_DEVICE, _NOISE = 0, 1  # streams of random numbers


@dataclass(frozen=True, kw_only=True)
class LaserScanner(Parameters, name="scanner"):
    """Range and error model of a scanner. Without arguments: an LMS200 in mm mode.

    Attributes:
        field_of_view_deg: from the first beam to the last, half of it to either side.
        resolution_deg: between beams; the last beam is the last that fits.
        range_min_m, range_max_m: nearer hits are −inf; farther ones, and none, are +inf (REP 117).
            The LMS200's least range is an assumption.
        step_m: ranges are rounded to multiples of it; 0: not at all.
        sigma_m: standard deviation of a range's statistical error, normally distributed.
        sigma_per_m: share of the range that adds to it, by the root of the sum of squares.
        systematic_error_m: the device's constant error lies between plus and minus this, evenly
            distributed (an assumption) and drawn once from the seed.
        seed: of the device: its constant error and all its noise.

    Raises:
        OpticsError: naming the parameter, what was expected and what was got.
    """

    field_of_view_deg: Annotated[Number, Field(gt=0.0, le=360.0)] = 180.0
    resolution_deg: Positive = 0.5
    range_min_m: NotNegative = 0.1
    range_max_m: Annotated[float, Field(strict=True, gt=0.0, allow_inf_nan=True)] = 8.19
    step_m: NotNegative = 0.001
    sigma_m: NotNegative = 0.005
    sigma_per_m: NotNegative = 0.0
    systematic_error_m: NotNegative = 0.015
    seed: Annotated[int, Field(strict=True, ge=0, le=MAX_SEED)] = 0

    def __repr__(self) -> str:
        beams = f"{len(self.angles_deg)} beams over {self.field_of_view_deg:g}°"
        return short_repr(self, beams, f"{self.range_min_m:g} to {self.range_max_m:g} m")

    def _check(self) -> None:
        if self.field_of_view_deg >= MAX_BEAMS * self.resolution_deg:
            raise self._error("resolution_deg", f"fewer than {MAX_BEAMS} beams")
        if self.range_min_m >= self.range_max_m:
            raise self._error("range_min_m", f"less than range_max_m = {self.range_max_m:g}")

    @classmethod
    def lms200(cls, resolution_deg: float = 0.5, mode: str = "mm", seed: int = 0) -> LaserScanner:
        """A SICK LMS200 as it can be set up.

        Args:
            resolution_deg: 1 or 0.5 over 180°, or 0.25 over 100° (an assumption).
            mode: "mm": to 8.19 m in steps of 1 mm; "cm": to 81.9 m in steps of 10 mm.
            seed: of the device.

        Raises:
            OpticsError: a resolution or mode that it does not have.
        """
        if resolution_deg not in _LMS200_FIELDS_DEG:
            raise OpticsError(
                f"scanner.resolution_deg: expected 1, 0.5 or 0.25, got {resolution_deg:g}"
            )
        if mode not in LMS200_MODES:
            raise OpticsError(f"scanner.mode: expected {' or '.join(LMS200_MODES)}, got {mode!r}")
        range_max_m, step_m = LMS200_MODES[mode]
        return cls(
            field_of_view_deg=_LMS200_FIELDS_DEG[resolution_deg],
            resolution_deg=resolution_deg,
            range_max_m=range_max_m,
            step_m=step_m,
            seed=seed,
        )

    @classmethod
    def usarsim(
        cls,
        *,
        scan_fov_rad: float = 3.14159,
        resolution_rad: float = 0.01745,
        max_range_m: float = 20.0,
        min_range_m: float = 0.0,
        noise: float = 0.001,
        seed: int = 0,
    ) -> LaserScanner:
        """The LMS200 as USARSim's configuration has it: ScanFov, Resolution, MaxRange, Noise.

        USARSim writes ranges with two decimals, and MaxRange where nothing is hit: here +inf. Its
        noise is a share of the range; that it is normally distributed is an assumption.

        Raises:
            OpticsError: values that no scanner can have.
        """
        return cls(
            field_of_view_deg=math.degrees(scan_fov_rad),
            resolution_deg=math.degrees(resolution_rad),
            range_min_m=min_range_m,
            range_max_m=max_range_m,
            step_m=0.01,
            sigma_m=0.0,
            sigma_per_m=noise,
            systematic_error_m=0.0,
            seed=seed,
        )

    def without_noise(self) -> LaserScanner:
        """The same scanner without statistical and systematic error; it still rounds."""
        return dataclasses.replace(self, sigma_m=0.0, sigma_per_m=0.0, systematic_error_m=0.0)

    def without_errors(self) -> LaserScanner:
        """The same scanner without noise and without rounding."""
        return dataclasses.replace(self.without_noise(), step_m=0.0)

    @property
    def beams(self) -> int:
        """Number of beams."""
        # 1e-9: steps that fit but for the rounding of floats
        return math.floor(self.field_of_view_deg / self.resolution_deg + 1e-9) + 1

    @cached_property
    def angles_deg(self) -> NDArray[np.float64]:
        """Angles (beams,) in degrees from straight ahead, positive to the left."""
        steps = np.arange(self.beams, dtype=np.float64)
        return -0.5 * self.field_of_view_deg + self.resolution_deg * steps

    @property
    def angle_min_rad(self) -> float:
        """Angle of the first beam, the rightmost."""
        return float(np.radians(self.angles_deg[0]))

    @property
    def angle_max_rad(self) -> float:
        """Angle of the last beam."""
        return float(np.radians(self.angles_deg[-1]))

    @property
    def angle_increment_rad(self) -> float:
        """Angle between beams."""
        return math.radians(self.resolution_deg)

    @property
    def reach_m(self) -> float:
        """Range beyond which no noise brings a surface back into range."""
        # ten sigmas happen once in 1e23 beams
        return (self.range_max_m + self.step_m + self.systematic_error_m + 10.0 * self.sigma_m) * (
            1.0 + 10.0 * self.sigma_per_m
        )

    @cached_property
    def device_error_m(self) -> float:
        """Constant error of the device with this seed."""
        bound = self.systematic_error_m
        return float(np.random.default_rng((self.seed, _DEVICE)).uniform(-bound, bound))

    def measure(self, true_ranges_m: NDArray[np.float64], scan_number: int) -> NDArray[np.float64]:
        """Measured ranges (beams,) in meters.

        Errors are added, the sum is rounded, and what then lies outside of the limits is −inf or
        +inf. The noise depends on the seed, the number of the scan and the beam alone, so
        that any scan of a drive can be made again by itself.

        Args:
            true_ranges_m: (beams,), +inf where nothing is hit.
            scan_number: of the drive; scans with the same number have the same noise.

        Raises:
            OpticsError: a scan number that is not a whole number of 32 bits.
        """
        is_whole = isinstance(scan_number, int | np.integer) and not isinstance(scan_number, bool)
        if not (is_whole and 0 <= scan_number <= MAX_SEED):
            raise OpticsError(
                f"scanner: scan_number: expected a whole number of 32 bits, got {scan_number!r}"
            )
        hit = np.isfinite(true_ranges_m)
        ranges = np.asarray(true_ranges_m, dtype=np.float64)[hit]
        if self.sigma_m or self.sigma_per_m:
            random = np.random.default_rng((self.seed, _NOISE, scan_number))
            noise = random.standard_normal(self.beams)[hit]  # the same for a beam, hit or not
            ranges = ranges + noise * np.hypot(self.sigma_m, self.sigma_per_m * ranges)
        ranges = ranges + self.device_error_m
        if self.step_m:
            # divided, not multiplied: 8190 steps are then 8.19, to the last bit
            steps_a_meter = 1.0 / self.step_m
            ranges = np.rint(ranges * steps_a_meter) / steps_a_meter
        measured = np.full(len(true_ranges_m), np.inf)
        measured[hit] = np.where(ranges > self.range_max_m, np.inf, ranges)
        measured[measured < self.range_min_m] = -np.inf
        return measured
