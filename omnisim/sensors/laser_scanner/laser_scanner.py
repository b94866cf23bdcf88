"""Laser range scanners: beams, limits, errors, and their scans of a scene.

Frame of the scanner: x forward, y left, z up (REP 103); the beams start at its origin and lie in
its
plane z = 0. They are numbered from right to left, counter-clockwise seen from above, as in ROS's
LaserScan and in USARSim.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field

from omnisim.core.errors import OpticsError
from omnisim.core.files.parameters import NotNegative, Number, Parameters, Positive, Seed
from omnisim.core.short_repr import short_repr
from omnisim.core.world import ObjectPart, WorldState
from omnisim.rendering.backend import RangeFinder
from omnisim.rendering.sensor_renderer import Mounting, SensorRenderer
from omnisim.rendering.shared_scene import SharedScene
from omnisim.sensors.commented_csv import write_commented_csv
from omnisim.sensors.device_noise import check_number, rounded

LMS200_MODES = {"mm": (8.19, 0.001), "cm": (81.9, 0.01)}  # range_max_m and step_m: 13 bits
_LMS200_FIELDS_DEG = {1.0: 180.0, 0.5: 180.0, 0.25: 100.0}  # by resolution
MAX_BEAMS = 100_000
_DEVICE, _NOISE = 0, 1  # streams of random numbers


@dataclass(frozen=True, kw_only=True)
class LaserScanner(Parameters, name="scanner"):
    """Range and error model of a scanner; the defaults are those of an LMS200 in mm mode.

    Attributes:
        field_of_view_deg: angle from the first beam to the last, centered ahead.
        resolution_deg: angle between beams; the last beam is the last that fits.
        range_min_m, range_max_m: limits; hits nearer are −inf, farther hits and misses +inf (REP
            117). The LMS200's minimum range is an assumption.
        step_m: step that ranges are rounded to; 0: no rounding.
        sigma_m: standard deviation of a range's statistical error, normally distributed.
        sigma_per_m: further standard deviation as a share of the range, added in quadrature.
        systematic_error_m: bound of the device's constant error, drawn once from the seed,
            uniformly (an assumption).
        seed: seed of the device: its constant error and all its noise.

    Raises:
        OpticsError: the message names the parameter, its value and the expected value.
    """

    field_of_view_deg: Annotated[Number, Field(gt=0.0, le=360.0)] = 180.0
    resolution_deg: Positive = 0.5
    range_min_m: NotNegative = 0.1
    range_max_m: Annotated[float, Field(strict=True, gt=0.0, allow_inf_nan=True)] = 8.19
    step_m: NotNegative = 0.001
    sigma_m: NotNegative = 0.005
    sigma_per_m: NotNegative = 0.0
    systematic_error_m: NotNegative = 0.015
    seed: Seed = 0

    def __repr__(self) -> str:
        beams = f"{len(self.angles_deg)} beams over {self.field_of_view_deg:g}°"
        return short_repr(self, beams, f"{self.range_min_m:g} to {self.range_max_m:g} m")

    def summary(self) -> str:
        """Beams and range."""
        return f"{self.beams} beams at {self.resolution_deg:.4g}° to {self.range_max_m:g} m"

    def open(self, stage: SharedScene, mounting: Mounting) -> LaserRenderer:
        """Open a renderer of scans on a stage."""
        return LaserRenderer(stage, self, mounting)

    def _check(self) -> None:
        if self.field_of_view_deg >= MAX_BEAMS * self.resolution_deg:
            raise self._error("resolution_deg", f"fewer than {MAX_BEAMS} beams")
        if self.range_min_m >= self.range_max_m:
            raise self._error("range_min_m", f"less than range_max_m = {self.range_max_m:g}")

    @classmethod
    def lms200(cls, resolution_deg: float = 0.5, mode: str = "mm", seed: int = 0) -> LaserScanner:
        """A SICK LMS200 in one of its configurations.

        Args:
            resolution_deg: 1 or 0.5 over 180°, or 0.25 over 100° (an assumption).
            mode: "mm": to 8.19 m in steps of 1 mm; "cm": to 81.9 m in steps of 10 mm.
            seed: seed of the device.

        Raises:
            OpticsError: a resolution or mode that the device does not have.
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
        """The LMS200 of USARSim's configuration: ScanFov, Resolution, MaxRange, Noise.

        USARSim writes ranges with two decimals, and MaxRange for a miss: here +inf. Its noise is a
        share of the range; the normal distribution is an assumption.

        Raises:
            OpticsError: values that no scanner has.
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
        """The same scanner without statistical and systematic errors; it still rounds."""
        return dataclasses.replace(self, sigma_m=0.0, sigma_per_m=0.0, systematic_error_m=0.0)

    def without_errors(self) -> LaserScanner:
        """The same scanner without noise and without rounding."""
        return dataclasses.replace(self.without_noise(), step_m=0.0)

    @property
    def beams(self) -> int:
        """Number of beams."""
        # 1e-9: steps that fit except for float rounding
        return math.floor(self.field_of_view_deg / self.resolution_deg + 1e-9) + 1

    @cached_property
    def angles_deg(self) -> NDArray[np.float64]:
        """Angles (beams,) in degrees from straight ahead, positive to the left."""
        steps = np.arange(self.beams, dtype=np.float64)
        return -0.5 * self.field_of_view_deg + self.resolution_deg * steps

    @cached_property
    def angles_rad(self) -> NDArray[np.float64]:
        """Angles (beams,) from straight ahead, positive to the left."""
        return np.radians(self.angles_deg)

    @property
    def angle_min_rad(self) -> float:
        """Angle of the first beam, the rightmost."""
        return float(self.angles_rad[0])

    @property
    def angle_max_rad(self) -> float:
        """Angle of the last beam."""
        return float(self.angles_rad[-1])

    @property
    def angle_increment_rad(self) -> float:
        """Angle between beams."""
        return math.radians(self.resolution_deg)

    @property
    def reach_m(self) -> float:
        """Range beyond which no noise brings a surface back into range."""
        # ten sigmas occur once in 1e23 beams
        return (self.range_max_m + self.step_m + self.systematic_error_m + 10.0 * self.sigma_m) * (
            1.0 + 10.0 * self.sigma_per_m
        )

    @cached_property
    def device_error_m(self) -> float:
        """Constant error of the device, from its seed."""
        bound = self.systematic_error_m
        return float(np.random.default_rng((self.seed, _DEVICE)).uniform(-bound, bound))

    def measure(self, true_ranges_m: NDArray[np.float64], scan_number: int) -> NDArray[np.float64]:
        """Measured ranges (beams,) in meters.

        Errors are added, the sum is rounded, and values outside the limits become −inf or +inf. The
        noise depends only on the seed, the scan number and the beam, so that any scan of a drive
        can be repeated alone.

        Args:
            true_ranges_m: (beams,), +inf for a miss.
            scan_number: number of the scan in its drive; equal numbers give equal noise.

        Raises:
            OpticsError: a scan number that is not a whole number of 32 bits.
        """
        check_number("scanner: scan_number", scan_number)
        hit = np.isfinite(true_ranges_m)
        ranges = np.asarray(true_ranges_m, dtype=np.float64)[hit]
        if self.sigma_m or self.sigma_per_m:
            random = np.random.default_rng((self.seed, _NOISE, scan_number))
            noise = random.standard_normal(self.beams)[hit]  # the same for a beam, hit or miss
            ranges = ranges + noise * np.hypot(self.sigma_m, self.sigma_per_m * ranges)
        ranges = ranges + self.device_error_m
        ranges = rounded(ranges, self.step_m)
        measured = np.full(len(true_ranges_m), np.inf)
        measured[hit] = np.where(ranges > self.range_max_m, np.inf, ranges)
        measured[measured < self.range_min_m] = -np.inf
        return measured


@dataclass(frozen=True, eq=False)
class Scan:
    """Ranges of a scanner, beam by beam from right to left.

    Attributes:
        angles_rad: (beams,) counter-clockwise from straight ahead.
        ranges_m: (beams,); +inf: out of range; −inf: too near (REP 117).
        scanner: scanner of the scan.
        world_from_scanner: (4, 4) pose of the scanner.
        metadata: omnisim's version, the scene, the scan number.
    """

    angles_rad: NDArray[np.float64]
    ranges_m: NDArray[np.float64]
    scanner: LaserScanner
    world_from_scanner: NDArray[np.float64]
    metadata: dict[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        beams, scene = len(self.angles_rad), self.metadata.get("scene")
        where = "" if scene is None else f"scene {scene!r}"
        return short_repr(self, f"{beams} beams", f"{np.count_nonzero(self.hit)} hits", where)

    @property
    def hit(self) -> NDArray[np.bool_]:
        """Mask (beams,) of beams with a range."""
        return np.isfinite(self.ranges_m)

    @property
    def points_m(self) -> NDArray[np.float64]:
        """Points (k, 3) of beams with a range, in the scanner's frame."""
        angles, ranges = self.angles_rad[self.hit], self.ranges_m[self.hit]
        return np.stack(
            (ranges * np.cos(angles), ranges * np.sin(angles), np.zeros_like(ranges)), axis=-1
        )

    def save_csv(self, path: str | Path) -> None:
        """Write the columns beam, angle_deg and range_m; atomically.

        The first lines are comments, `# key: value` with JSON values: the metadata, the scanner's
        parameters by name, and `world_from_scanner`, the pose by rows. Ranges are `inf` out of
        range and
        `-inf` too near, as NumPy reads them.

        Raises:
            OutputError: the file cannot be written.
        """
        header = {
            **self.metadata,
            **dataclasses.asdict(self.scanner),
            "world_from_scanner": self.world_from_scanner.tolist(),
        }
        rows = (
            f"{beam},{angle:.6f},{range_m:.6f}"
            for beam, (angle, range_m) in enumerate(
                zip(np.degrees(self.angles_rad), self.ranges_m, strict=True)
            )
        )
        write_commented_csv(path, header, "beam,angle_deg,range_m", rows)


class LaserRenderer(SensorRenderer[LaserScanner, RangeFinder]):
    """Renderer of a scanner's scans of a scene."""

    def _open_passes(self, hidden: frozenset[ObjectPart]) -> RangeFinder:
        angles_rad, reach_m = self.sensor.angles_rad, self.sensor.reach_m
        return self._stage.backend.range_finder(angles_rad, reach_m, hidden)

    def scan(self, state: WorldState | ArrayLike, scan_number: int = 0) -> Scan:
        """Take one scan.

        Args:
            state: world state; or, if nothing else moves, the pose (4, 4) of the vehicle.
            scan_number: number of the scan in its drive; the noise depends on it and the scanner's
                seed only.

        Raises:
            OmnisimError: an invalid pose, an object without a pose, an invalid scan number, or the
                renderer or its stage is closed.
        """
        now = self._state(state)
        world_from_scanner = self._world_from_sensor(now)
        with self._current() as ranges:
            true_ranges_m = ranges.cast(world_from_scanner, self._stage.poses_in(now))
        ranges_m = self.sensor.measure(true_ranges_m, scan_number)
        metadata = self._metadata(scan_number=int(scan_number))
        if self.body is not None:
            metadata["world_from_base"] = now.world_from_object[self.vehicle].tolist()
        return Scan(self.sensor.angles_rad, ranges_m, self.sensor, world_from_scanner, metadata)
