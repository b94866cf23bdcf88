"""Planar laser range scanners on vehicles: the SICK LMS200, and USARSim's."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal

from pydantic import AfterValidator, Field

from omnisim.core.files.parameters import AboveZero, Level, Number, Seed
from omnisim.sensors.laser_scanner.laser_scanner import LaserRenderer, LaserScanner
from omnisim.sensors.sensor import (
    TABLE_SUFFIX,
    DriveSettings,
    FileMeasurement,
    Moment,
    MountedSensor,
    RenderedSensor,
)
from omnisim.sensors.sensor_mount import SensorMount


class MountedScanner(RenderedSensor):
    """Laser scanner on its vehicle."""

    sensor: LaserScanner
    noun: ClassVar[str] = "scanner"
    suffixes: ClassVar[tuple[str, ...]] = (TABLE_SUFFIX,)

    def measure(
        self, renderer: LaserRenderer, settings: DriveSettings, moment: Moment
    ) -> FileMeasurement:
        """Take the scan at a moment."""
        scan = renderer.scan(moment.motion(moment.time_s), moment.number)
        return FileMeasurement(TABLE_SUFFIX, scan.save_csv)


def _check_resolution(resolution_deg: float) -> float:
    if resolution_deg not in (1.0, 0.5, 0.25):
        raise ValueError("expected 1, 0.5 or 0.25")
    return resolution_deg


class Lms200Mount(SensorMount):
    """SICK LMS200 with the errors of one device."""

    sensor_class: ClassVar[type[MountedSensor]] = MountedScanner

    type: Literal["lms200"]
    resolution_deg: Annotated[Number, AfterValidator(_check_resolution)] = 0.5
    """Degrees between beams: 1 or 0.5 over 180°, or 0.25 over 100°."""
    mode: Literal["mm", "cm"] = "mm"
    """Range and step: "mm" for 8.19 m and 1 mm, "cm" for 81.9 m and 1 cm."""
    noise: Annotated[bool, Field(strict=True)] = True
    """True: the device's errors; false: none."""
    seed: Seed = 0
    """Seed of the device's errors."""

    def parameters(self) -> LaserScanner:
        """Build the LMS200."""
        scanner = LaserScanner.lms200(self.resolution_deg, self.mode, self.seed)
        return scanner if self.noise else scanner.without_noise()


class RangeScannerMount(SensorMount):
    """Range scanner of USARSim's configuration; by default its SICK LMS200."""

    sensor_class: ClassVar[type[MountedSensor]] = MountedScanner

    type: Literal["usarsim_range_scanner"]
    scan_fov_rad: Annotated[Number, Field(gt=0.0, le=6.2832)] = 3.14159
    """Radians from the first beam to the last: USARSim's ScanFov."""
    resolution_rad: AboveZero = 0.01745
    """Radians between beams: USARSim's Resolution."""
    max_range_m: AboveZero = 20.0
    """Meters; farther hits are out of range: USARSim's MaxRange."""
    min_range_m: Level = 0.0
    """Meters; nearer hits are too near: USARSim's MinRange."""
    noise_share: Level = 0.001
    """Standard deviation as a share of the range: USARSim's Noise."""
    seed: Seed = 0
    """Seed of the device's noise."""

    def parameters(self) -> LaserScanner:
        """Build USARSim's scanner."""
        return LaserScanner.usarsim(
            # a full turn, whose last digit is rounded up
            scan_fov_rad=min(self.scan_fov_rad, 2.0 * math.pi),
            resolution_rad=self.resolution_rad,
            max_range_m=self.max_range_m,
            min_range_m=self.min_range_m,
            noise=self.noise_share,
            seed=self.seed,
        )
