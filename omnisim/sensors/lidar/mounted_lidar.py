"""Spinning 3-D lidars on vehicles: point clouds skewed by the motion within a revolution."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from omnisim.core.files.parameters import Flag, overriding
from omnisim.sensors.lidar.spinning_lidar import LidarRenderer, SpinningLidar
from omnisim.sensors.rate import LATE
from omnisim.sensors.sensor import (
    DriveSettings,
    FileMeasurement,
    Moment,
    MountedSensor,
    RenderedSensor,
    StepContent,
)
from omnisim.sensors.sensor_mount import Rate, SensorMount

STATES = 16  # number of recorded true states per revolution
DEVICES = {"vlp16": SpinningLidar.vlp16, "hdl64e": SpinningLidar.hdl64e}


@dataclass(frozen=True, eq=False, repr=False)
class MountedLidar(RenderedSensor):
    """Lidar mounted on a vehicle.

    Attributes:
        file_format: format of the point clouds, "ply" or "pcd".
    """

    sensor: SpinningLidar
    file_format: str = "ply"
    noun: ClassVar[str] = "lidar"
    suffixes: ClassVar[tuple[str, ...]] = (".ply", ".pcd")
    has_instances: ClassVar[bool] = True

    def state_times_s(self, times_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Times (m,) within all revolutions, dense enough for removing a cloud's skew."""
        since_s = np.arange(STATES) / (STATES * self.sensor.rate_hz)
        return (times_s[:, None] - since_s).ravel()

    def note(self, times_s: NDArray[np.float64]) -> str | None:
        """Notice that revolutions between the steps have no cloud; None if all have one."""
        turns = int(float(np.ptp(times_s)) * self.sensor.rate_hz + LATE) + 1
        if self.rate is not None or turns <= len(times_s):
            return None
        return (
            f"{self.name}: a cloud at each step, of {len(times_s)} of the lidar's {turns} "
            f"revolutions: rate_hz = {self.sensor.rate_hz:g} in its table takes all"
        )

    def settings(self) -> dict[str, Any]:
        """Setting with the format of the point clouds."""
        return {"file_format": self.file_format}

    @classmethod
    def suffixes_of(cls, content: StepContent) -> tuple[str, ...]:
        """Suffix of the run's point clouds."""
        return (f".{content.settings['file_format']}",)

    def measure(
        self, renderer: LidarRenderer, settings: DriveSettings, moment: Moment
    ) -> FileMeasurement:
        """Render the cloud of the revolution that ends at a moment."""
        cloud = renderer.scan(moment.motion, moment.time_s, moment.number)
        return FileMeasurement(f".{self.file_format}", cloud.save)


@overriding(SpinningLidar)
class LidarMount(SensorMount):
    """Spinning 3-D lidar; missing keys default to the device's values."""

    sensor_class: ClassVar[type[MountedSensor]] = MountedLidar

    type: Literal["lidar"]
    device: Literal["vlp16", "hdl64e"] = "vlp16"
    """Velodyne's VLP-16 (16 rings, ±15°) or HDL-64E S2 (64 rings, −24.3° to 2°)."""
    noise: Flag = True
    """True: the device's noise; false: ranges are exact except for rounding."""
    file_format: Literal["ply", "pcd"] = "ply"
    """Binary format of the point clouds: PLY, or PCD of the Point Cloud Library."""
    rate_hz: Rate | None = None
    """Revolutions per second, with one cloud each. Default: the device's, with a cloud per step."""

    def parameters(self) -> SpinningLidar:
        """Build the lidar's parameters."""
        lidar = self.overriding(DEVICES[self.device]())
        return lidar if self.noise else lidar.without_noise()

    def settings(self) -> dict[str, Any]:
        """File format of the mounted lidar."""
        return {"file_format": self.file_format}
