"""Planar laser range scanners on vehicles: the SICK LMS200, and USARSim's."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field

from omnisim.core.errors import OpticsError, RobotFileError
from omnisim.core.files.parameters import Number
from omnisim.rendering.stage import Stage
from omnisim.sensors.laser_scanner.laser_renderer import LaserRenderer
from omnisim.sensors.laser_scanner.laser_scanner import LaserScanner
from omnisim.sensors.sensor import (
    TABLE_SUFFIX,
    DriveSettings,
    Instrument,
    Moment,
    MountedSensor,
    RendererInstrument,
    TableMeasurement,
)
from omnisim.sensors.sensor_mount import Level, Positive, Seed, SensorMount


@dataclass(frozen=True, eq=False, repr=False)
class MountedScanner(MountedSensor):
    """Laser scanner on its vehicle.

    Attributes:
        scanner: range and error model.
        base_from_scanner: (4, 4).
    """

    scanner: LaserScanner
    base_from_scanner: NDArray[np.float64]
    noun: ClassVar[str] = "scanner"
    suffixes: ClassVar[tuple[str, ...]] = (TABLE_SUFFIX,)

    @property
    def origin_m(self) -> NDArray[np.float64]:
        """Origin of its beams (3,), base."""
        return self.base_from_scanner[:3, 3]

    def summary(self) -> str:
        """Beams and range."""
        scanner = self.scanner
        return (
            f"{scanner.beams} beams at {scanner.resolution_deg:.4g}° to {scanner.range_max_m:g} m"
        )

    def open(self, stage: Stage, settings: DriveSettings) -> Instrument:
        """Open a renderer of scans."""
        renderer = LaserRenderer(
            stage,
            self.scanner,
            base_from_scanner=self.base_from_scanner,
            hidden=self.hides,
            vehicle=settings.vehicle,
        )
        return ScannerInstrument(renderer)


class _ScannerMount(SensorMount):
    """Keys of all laser scanners."""

    sensor_class: ClassVar[type[MountedSensor]] = MountedScanner

    def scanner(self) -> LaserScanner:
        """Build the range and error model.

        Raises:
            OpticsError: a scanner that cannot be.
        """
        raise NotImplementedError

    def sensor(self, folder: Path, source: str) -> MountedSensor:
        """Mount the scanner."""
        try:
            scanner = self.scanner()
        except OpticsError as reason:
            raise RobotFileError(f"{source}: {str(reason).removeprefix('scanner.')}") from None
        return MountedScanner(self.type, self.name, self.hides, scanner, self.base_from_mount)


def _check_resolution(resolution_deg: float) -> float:
    if resolution_deg not in (1.0, 0.5, 0.25):
        raise ValueError("expected 1, 0.5 or 0.25")
    return resolution_deg


class Lms200Mount(_ScannerMount):
    """SICK LMS200, with the errors of one device."""

    type: Literal["lms200"]
    resolution_deg: Annotated[Number, AfterValidator(_check_resolution)] = 0.5
    """Degrees between beams: 1 or 0.5 over 180°, or 0.25 over 100°."""
    mode: Literal["mm", "cm"] = "mm"
    """Range and step: "mm" to 8.19 m by 1 mm, "cm" to 81.9 m by 1 cm."""
    noise: Annotated[bool, Field(strict=True)] = True
    """True: with the device's errors."""
    seed: Seed = 0
    """Seed of the device: its errors follow from it."""

    def scanner(self) -> LaserScanner:
        """Build the LMS200."""
        scanner = LaserScanner.lms200(self.resolution_deg, self.mode, self.seed)
        return scanner if self.noise else scanner.without_noise()


class RangeScannerMount(_ScannerMount):
    """Range scanner as USARSim's configuration has it; by default its SICK LMS200."""

    type: Literal["usarsim_range_scanner"]
    scan_fov_rad: Annotated[Number, Field(gt=0.0, le=6.2832)] = 3.14159
    """Radians from the first beam to the last: USARSim's ScanFov."""
    resolution_rad: Positive = 0.01745
    """Radians between beams: USARSim's Resolution."""
    max_range_m: Positive = 20.0
    """Meters; farther hits are out of range: USARSim's MaxRange."""
    min_range_m: Level = 0.0
    """Meters; nearer hits are too near: USARSim's MinRange."""
    noise_share: Level = 0.001
    """Standard deviation as a share of the range: USARSim's Noise."""
    seed: Seed = 0
    """Seed of the device: its noise follows from it."""

    def scanner(self) -> LaserScanner:
        """Build USARSim's scanner."""
        return LaserScanner.usarsim(
            # a turn, whose last digit is rounded up
            scan_fov_rad=min(self.scan_fov_rad, 2.0 * math.pi),
            resolution_rad=self.resolution_rad,
            max_range_m=self.max_range_m,
            min_range_m=self.min_range_m,
            noise=self.noise_share,
            seed=self.seed,
        )


class ScannerInstrument(RendererInstrument[LaserRenderer]):
    """Takes a laser scanner's scans."""

    def measure(self, moment: Moment) -> TableMeasurement:
        """Take the scan of a moment."""
        return TableMeasurement(self._renderer.scan(moment.motion(moment.time_s), moment.number))
