"""Planar laser range scanners on vehicles: the SICK LMS200 and USARSim's scanner."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal

from pydantic import AfterValidator, Field

from omnisim.core.files.parameters import AboveZero, Flag, Level, Number, overriding
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
    """Laser scanner mounted on a vehicle."""

    sensor: LaserScanner
    noun: ClassVar[str] = "scanner"
    suffixes: ClassVar[tuple[str, ...]] = (TABLE_SUFFIX,)

    def measure(
        self, renderer: LaserRenderer, settings: DriveSettings, moment: Moment
    ) -> FileMeasurement:
        """Render the scan at a moment."""
        scan = renderer.scan(moment.motion(moment.time_s), moment.number)
        return FileMeasurement(TABLE_SUFFIX, scan.save_csv)


def _check_resolution(resolution_deg: float) -> float:
    if resolution_deg not in (1.0, 0.5, 0.25):
        raise ValueError("expected 1, 0.5 or 0.25")
    return resolution_deg


@overriding(LaserScanner, "seed", "specular", defaults={})
class Lms200Mount(SensorMount):
    """SICK LMS200 with the errors of one individual device."""

    sensor_class: ClassVar[type[MountedSensor]] = MountedScanner

    type: Literal["lms200"]
    resolution_deg: Annotated[Number, AfterValidator(_check_resolution)] = 0.5
    """Angle between beams in degrees: 1 or 0.5 over 180°, or 0.25 over 100°."""
    mode: Literal["mm", "cm"] = "mm"
    """Range and step: "mm" up to 8.19 m by 1 mm, "cm" up to 81.9 m by 1 cm."""
    noise: Flag = True
    """True: the device's errors; false: ranges are exact except for rounding."""

    def parameters(self) -> LaserScanner:
        """Build the LMS200's parameters."""
        scanner = self.overriding(LaserScanner.lms200(self.resolution_deg, self.mode))
        return scanner if self.noise else scanner.without_noise()


@overriding(LaserScanner, "seed", "specular", defaults={})
class RangeScannerMount(SensorMount):
    """Range scanner with USARSim's parameters; the default is USARSim's SICK LMS200."""

    sensor_class: ClassVar[type[MountedSensor]] = MountedScanner

    type: Literal["usarsim_range_scanner"]
    scan_fov_rad: Annotated[Number, Field(gt=0.0, le=6.2832)] = 3.14159
    """Angle from the first beam to the last in radians: USARSim's ScanFov."""
    resolution_rad: AboveZero = 0.01745
    """Angle between beams in radians: USARSim's Resolution."""
    max_range_m: AboveZero = 20.0
    """Maximum range in meters; farther hits are out of range: USARSim's MaxRange."""
    min_range_m: Level = 0.0
    """Minimum range in meters; nearer hits are too near: USARSim's MinRange."""
    noise_share: Level = 0.001
    """Standard deviation relative to the range: USARSim's Noise."""

    def parameters(self) -> LaserScanner:
        """Build the parameters of USARSim's scanner."""
        scanner = LaserScanner.usarsim(
            # 6.2832 is a full turn with its last digit rounded up
            scan_fov_rad=min(self.scan_fov_rad, 2.0 * math.pi),
            resolution_rad=self.resolution_rad,
            max_range_m=self.max_range_m,
            min_range_m=self.min_range_m,
            noise=self.noise_share,
        )
        return self.overriding(scanner)
