"""Laser range scanners: beams, limits, errors and scans.

The scanner's frame has x forward, y left and z up (REP 103). The beams lie in its plane z = 0 and
start at its origin. They are numbered from right to left, counter-clockwise as seen from above, as
in ROS's LaserScan and USARSim.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike
from pydantic import AfterValidator, Field

from omnisim.core.arrays import Bools, Floats
from omnisim.core.errors import OpticsError
from omnisim.core.files import parameters
from omnisim.core.pending import Pending
from omnisim.core.short_repr import short_repr
from omnisim.core.world import ObjectPart, WorldState
from omnisim.ground_truth.hits import EchoLimits, ScanBeams
from omnisim.rendering.contract import RangeFinder
from omnisim.rendering.instrument import Instrument
from omnisim.rendering.sensor import TABLE_SUFFIX, Moment, Mount, SensorSettings
from omnisim.rendering.shared_scene import SharedScene
from omnisim.sensors import device_data
from omnisim.sensors.sensor_table import SensorTable

LMS200_MODES = {"mm": (8.19, 0.001), "cm": (81.9, 0.01)}  # range_max_m and step_m: 13 bits
_LMS200_FIELDS_DEG = {1.0: 180.0, 0.5: 180.0, 0.25: 100.0}  # by resolution
MAX_BEAMS = 100_000
_DEVICE, _NOISE = 0, 1  # streams of random numbers


@dataclass(frozen=True, kw_only=True)
class LaserScanner(parameters.Parameters, SensorSettings, name="scanner"):
    """Range and error model of a scanner; the default is an LMS200 in mm mode."""

    field_of_view_deg: Annotated[parameters.Number, Field(gt=0.0, le=360.0)] = 180.0
    """Angle from the first beam to the last, symmetric about straight ahead."""
    resolution_deg: parameters.Positive = 0.5
    """Angle between beams; the last beam is the last that fits."""
    range_min_m: parameters.NotNegative = 0.1
    """Minimum range; nearer hits are −inf (REP 117). That of the LMS200 is an assumption."""
    range_max_m: Annotated[float, Field(strict=True, gt=0.0, allow_inf_nan=True)] = 8.19
    """Maximum range; farther hits and misses are +inf."""
    step_m: parameters.NotNegative = 0.001
    """Ranges are rounded to multiples of this step; 0: no rounding."""
    sigma_m: parameters.NotNegative = 0.005
    """Standard deviation of a range's normally distributed error."""
    sigma_per_m: parameters.NotNegative = 0.0
    """Relative error, added to `sigma_m` as the root of the sum of squares."""
    systematic_error_m: parameters.NotNegative = 0.015
    """Bound of the device's constant error, which is drawn once from the seed. Its uniform
    distribution is an assumption."""
    seed: parameters.Seed = 0
    """Seed of the device, which determines its errors."""
    specular: parameters.Flag = True
    """True: beams pass panes and are reflected by mirrors, in scenes with such materials, and the
    strongest return counts; false: they end at the first surface."""
    min_intensity: parameters.Fraction = 0.1
    """Faintest return at the maximum range, as that of `SpinningLidar`; an assumption."""

    noun: ClassVar[str] = "scanner"
    suffixes: ClassVar[tuple[str, ...]] = (TABLE_SUFFIX,)

    def __repr__(self) -> str:
        beams = f"{len(self.angles_deg)} beams over {self.field_of_view_deg:g}°"
        return short_repr(self, beams, f"{self.range_min_m:g} to {self.range_max_m:g} m")

    def summary(self) -> str:
        """Short description: beams and range."""
        return f"{self.beams} beams at {self.resolution_deg:.4g}° to {self.range_max_m:g} m"

    def open(self, stage: SharedScene, mount: Mount[object]) -> LaserRenderer:
        """Open a renderer of scans on a stage."""
        return LaserRenderer(stage, self, mount)

    def _check(self) -> None:
        if self.field_of_view_deg >= MAX_BEAMS * self.resolution_deg:
            raise self._error("resolution_deg", f"fewer than {MAX_BEAMS} beams")
        if self.range_min_m >= self.range_max_m:
            raise self._error("range_min_m", f"less than range_max_m = {self.range_max_m:g}")

    @classmethod
    def lms200(cls, resolution_deg: float = 0.5, mode: str = "mm", seed: int = 0) -> LaserScanner:
        """SICK LMS200 in one of its configurations.

        Args:
            resolution_deg: 1 or 0.5 over 180°, or 0.25 over 100° (an assumption).
            mode: "mm": up to 8.19 m in steps of 1 mm; "cm": up to 81.9 m in steps of 10 mm.
            seed: seed of the device.

        Raises:
            OpticsError: the LMS200 lacks this resolution or mode.
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
        """LMS200 with USARSim's parameters: ScanFov, Resolution, MaxRange, MinRange and Noise.

        USARSim writes ranges with two decimals, and MaxRange for misses, which are +inf here. Its
        noise is relative to the range; the normal distribution is an assumption.

        Raises:
            OpticsError: invalid parameters.
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
        """Copy of the scanner without random and systematic errors; ranges are still rounded."""
        return dataclasses.replace(self, sigma_m=0.0, sigma_per_m=0.0, systematic_error_m=0.0)

    def without_errors(self) -> LaserScanner:
        """Copy of the scanner without noise and rounding."""
        return dataclasses.replace(self.without_noise(), step_m=0.0)

    @property
    def beams(self) -> int:
        """Number of beams."""
        # 1e-9: tolerates rounding errors of a step that fits exactly
        return math.floor(self.field_of_view_deg / self.resolution_deg + 1e-9) + 1

    @cached_property
    def angles_deg(self) -> Floats:
        """Angles (beams,) in degrees from straight ahead, positive to the left."""
        steps = np.arange(self.beams, dtype=np.float64)
        return -0.5 * self.field_of_view_deg + self.resolution_deg * steps

    @cached_property
    def angles_rad(self) -> Floats:
        """Angles (beams,) in radians from straight ahead, positive to the left."""
        return np.radians(self.angles_deg)

    @property
    def angle_min_rad(self) -> float:
        """Angle of the first, rightmost beam."""
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
        """Range beyond which noise brings no surface back into range."""
        # ten sigmas occur once in 1e23 beams
        return (self.range_max_m + self.step_m + self.systematic_error_m + 10.0 * self.sigma_m) * (
            1.0 + 10.0 * self.sigma_per_m
        )

    @cached_property
    def device_error_m(self) -> float:
        """Constant error of the device, determined by the seed."""
        bound = self.systematic_error_m
        return float(np.random.default_rng((self.seed, _DEVICE)).uniform(-bound, bound))

    def measure(self, true_ranges_m: Floats, scan_number: int) -> Floats:
        """Simulate measured ranges (beams,) in meters.

        Errors are added and the sum is rounded; ranges outside the limits become −inf or +inf. The
        noise depends only on the seed, the scan number and the beam, so any scan of a drive can be
        reproduced separately.

        Args:
            true_ranges_m: (beams,) true ranges, +inf for misses.
            scan_number: index of the scan in the drive; equal numbers have equal noise.

        Raises:
            OpticsError: the scan number is not a whole number of 32 bits.
        """
        device_data.check_number("scanner: scan_number", scan_number)
        hit = np.isfinite(true_ranges_m)
        ranges = np.asarray(true_ranges_m, dtype=np.float64)[hit]
        if self.sigma_m or self.sigma_per_m:
            random = np.random.default_rng((self.seed, _NOISE, scan_number))
            noise = random.standard_normal(self.beams)[hit]  # independent of which beams hit
            ranges = ranges + noise * np.hypot(self.sigma_m, self.sigma_per_m * ranges)
        ranges = ranges + self.device_error_m
        ranges = device_data.round_ranges(ranges, self.step_m)
        measured = np.full(len(true_ranges_m), np.inf)
        measured[hit] = np.where(ranges > self.range_max_m, np.inf, ranges)
        measured[measured < self.range_min_m] = -np.inf
        return measured


@dataclass(frozen=True, eq=False)
class Scan:
    """Measured ranges of one scan, beam by beam from right to left.

    Attributes:
        angles_rad: (beams,) angles counter-clockwise from straight ahead.
        ranges_m: (beams,) ranges; +inf: out of range; −inf: too near (REP 117).
        scanner: scanner of the scan.
        world_from_scanner: (4, 4) pose of the scanner.
        metadata: omnisim's version, the scene and the scan number.
    """

    angles_rad: Floats
    ranges_m: Floats
    scanner: LaserScanner
    world_from_scanner: Floats
    metadata: dict[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        beams, scene = len(self.angles_rad), self.metadata.get("scene")
        where = "" if scene is None else f"scene {scene!r}"
        return short_repr(self, f"{beams} beams", f"{np.count_nonzero(self.hit)} hits", where)

    @property
    def hit(self) -> Bools:
        """Mask (beams,) of the beams with a finite range."""
        return np.isfinite(self.ranges_m)

    @property
    def points_m(self) -> Floats:
        """Points (k, 3) in the scanner's frame, one per beam with a finite range."""
        angles, ranges = self.angles_rad[self.hit], self.ranges_m[self.hit]
        return np.stack(
            (ranges * np.cos(angles), ranges * np.sin(angles), np.zeros_like(ranges)), axis=-1
        )

    def save(self, stem: Path) -> None:
        """Write the scan as CSV, see `save_csv`.

        Raises:
            OutputError: the file cannot be written.
        """
        self.save_csv(stem.with_suffix(TABLE_SUFFIX))

    def save_csv(self, path: str | Path) -> None:
        """Atomically write the columns beam, angle_deg and range_m.

        Comment lines `# key: value` with JSON values come first: the metadata, the scanner's
        parameters under their own names, and the pose `world_from_scanner` row by row. Ranges are
        `inf` if out of range and `-inf` if too near, in NumPy's notation.

        Raises:
            OutputError: the file cannot be written.
        """
        header = {
            **self.metadata,
            **device_data.stated_parameters(self.scanner),
            "world_from_scanner": self.world_from_scanner.tolist(),
        }
        rows = (
            f"{beam},{angle:.6f},{range_m:.6f}"
            for beam, (angle, range_m) in enumerate(
                zip(np.degrees(self.angles_rad), self.ranges_m, strict=True)
            )
        )
        device_data.write_commented_csv(path, header, "beam,angle_deg,range_m", rows)


class LaserRenderer(Instrument[LaserScanner, RangeFinder, Scan]):
    """Renders a scanner's scans of a scene."""

    def _open_passes(self, hidden: frozenset[ObjectPart]) -> RangeFinder:
        sensor = self.sensor
        limits = EchoLimits(1, sensor.min_intensity, sensor.range_max_m)
        beams = ScanBeams(sensor.angles_rad, sensor.reach_m, limits if sensor.specular else None)
        return self._stage.backend.range_finder(beams, hidden)

    def begin(self, moment: Moment) -> Pending[Scan]:
        """Render the scan at a moment."""
        return Pending.done(self.scan(moment.motion(moment.time_s), moment.number))

    def scan(self, state: WorldState | ArrayLike, scan_number: int = 0) -> Scan:
        """Render one scan.

        Args:
            state: state of the world; if nothing else moves, the vehicle's (4, 4) pose suffices.
            scan_number: index of the scan in the drive; with the scanner's seed it determines the
                noise.

        Raises:
            OmnisimError: an invalid pose, an object without a pose, an invalid scan number, or a
                closed renderer or stage.
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


# Tables of a robot file.


def _check_resolution(resolution_deg: float) -> float:
    if resolution_deg not in (1.0, 0.5, 0.25):
        raise ValueError("expected 1, 0.5 or 0.25")
    return resolution_deg


@parameters.overriding(LaserScanner, "seed", "specular", defaults={})
class Lms200Table(SensorTable):
    """SICK LMS200 with the errors of one individual device."""

    sensor_class: ClassVar[type[SensorSettings]] = LaserScanner

    type: Literal["lms200"]
    resolution_deg: Annotated[parameters.Number, AfterValidator(_check_resolution)] = 0.5
    """Angle between beams in degrees: 1 or 0.5 over 180°, or 0.25 over 100°."""
    mode: Literal["mm", "cm"] = "mm"
    """Range and resolution: "mm" (up to 8.19 m in 1 mm steps) or "cm" (up to 81.9 m in 1 cm
    steps)."""
    noise: parameters.Flag = True
    """True: the device's errors; false: ranges are exact except for rounding."""

    def sensor(self) -> LaserScanner:
        """Build the LMS200's settings."""
        scanner = self.overriding(LaserScanner.lms200(self.resolution_deg, self.mode))
        return scanner if self.noise else scanner.without_noise()


@parameters.overriding(LaserScanner, "seed", "specular", defaults={})
class RangeScannerTable(SensorTable):
    """Range scanner with USARSim's parameters; the default is USARSim's SICK LMS200."""

    sensor_class: ClassVar[type[SensorSettings]] = LaserScanner

    type: Literal["usarsim_range_scanner"]
    scan_fov_rad: Annotated[parameters.Number, Field(gt=0.0, le=6.2832)] = 3.14159
    """Angle from the first beam to the last in radians: USARSim's ScanFov."""
    resolution_rad: parameters.AboveZero = 0.01745
    """Angle between beams in radians: USARSim's Resolution."""
    max_range_m: parameters.AboveZero = 20.0
    """Maximum range in meters; farther hits are out of range: USARSim's MaxRange."""
    min_range_m: parameters.Level = 0.0
    """Minimum range in meters; nearer hits are too near: USARSim's MinRange."""
    noise_share: parameters.Level = 0.001
    """Standard deviation relative to the range: USARSim's Noise."""

    def sensor(self) -> LaserScanner:
        """Build the settings of USARSim's scanner."""
        scanner = LaserScanner.usarsim(
            # 6.2832 is a full turn with its last digit rounded up
            scan_fov_rad=min(self.scan_fov_rad, 2.0 * math.pi),
            resolution_rad=self.resolution_rad,
            max_range_m=self.max_range_m,
            min_range_m=self.min_range_m,
            noise=self.noise_share,
        )
        return self.overriding(scanner)
