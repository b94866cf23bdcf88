"""Spinning 3-D lidars on vehicles: a point cloud a step, skewed by the motion."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from omnisim.core.errors import OpticsError, RobotFileError
from omnisim.core.files.parameters import Number
from omnisim.core.files.written_files import is_written
from omnisim.ground_truth.npy import ChannelFormat
from omnisim.rendering.stage import Stage
from omnisim.sensors.lidar.lidar_renderer import LidarRenderer
from omnisim.sensors.lidar.point_cloud import PointCloud
from omnisim.sensors.lidar.spinning_lidar import SpinningLidar
from omnisim.sensors.rate import LATE
from omnisim.sensors.sensor import (
    DriveSettings,
    Instrument,
    Measurement,
    Moment,
    MountedSensor,
    RendererInstrument,
)
from omnisim.sensors.sensor_mount import Level, Positive, Rate, Seed, SensorMount

STATES = 16  # true states in a revolution
DEVICES = {"vlp16": SpinningLidar.vlp16, "hdl64e": SpinningLidar.hdl64e}


@dataclass(frozen=True, eq=False, repr=False)
class MountedLidar(MountedSensor):
    """Lidar on its vehicle.

    Attributes:
        lidar: rings and range model.
        base_from_lidar: (4, 4).
        file_format: of its point clouds, "ply" or "pcd".
    """

    lidar: SpinningLidar
    base_from_lidar: NDArray[np.float64]
    file_format: str = "ply"
    noun: ClassVar[str] = "lidar"
    suffixes: ClassVar[tuple[str, ...]] = (".ply", ".pcd")
    has_instances: ClassVar[bool] = True

    @property
    def origin_m(self) -> NDArray[np.float64]:
        """Origin of its beams (3,), base."""
        return self.base_from_lidar[:3, 3]

    def summary(self) -> str:
        """Rings, firings and range."""
        lidar = self.lidar
        return (
            f"{lidar.rings} rings × {lidar.firings} firings at {lidar.rate_hz:g} Hz "
            f"to {lidar.range_max_m:g} m"
        )

    def state_times_s(self, times_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Times within all revolutions, close enough to take the skew out of a cloud."""
        since_s = np.arange(STATES) / (STATES * self.lidar.rate_hz)
        return (times_s[:, None] - since_s).ravel()

    def note(self, times_s: NDArray[np.float64]) -> str | None:
        """Note on revolutions between the steps, which have no cloud."""
        turns = int(float(np.ptp(times_s)) * self.lidar.rate_hz + LATE) + 1
        if self.rate is not None or turns <= len(times_s):
            return None
        return (
            f"{self.name}: a cloud at each step, of {len(times_s)} of the lidar's {turns} "
            f"revolutions: rate_hz = {self.lidar.rate_hz:g} in its table takes all"
        )

    def settings(self) -> dict[str, Any]:
        """Format of its files."""
        return {"file_format": self.file_format}

    @classmethod
    def suffixes_of(
        cls,
        channels: Collection[str],
        channel_format: ChannelFormat,
        boxes_3d: bool,
        settings: Mapping[str, Any],
    ) -> tuple[str, ...]:
        """Suffix of its format."""
        return (f".{settings['file_format']}",)

    def open(self, stage: Stage, settings: DriveSettings) -> Instrument:
        """Open a renderer of point clouds."""
        renderer = LidarRenderer(
            stage,
            self.lidar,
            base_from_lidar=self.base_from_lidar,
            hidden=self.hides,
            vehicle=settings.vehicle,
        )
        return LidarInstrument(renderer, self.file_format)


class LidarMount(SensorMount):
    """Spinning 3-D lidar; keys that are left out are those of its device."""

    sensor_class: ClassVar[type[MountedSensor]] = MountedLidar

    type: Literal["lidar"]
    device: Literal["vlp16", "hdl64e"] = "vlp16"
    """Velodyne's VLP-16 (16 rings, ±15°) or HDL-64E S2 (64 rings, −24.3° to 2°)."""
    noise: Annotated[bool, Field(strict=True)] = True
    """True: with the device's noise; false: ranges are exact, but for their steps."""
    seed: Seed = 0
    """Seed of the device: its noise follows from it."""
    file_format: Literal["ply", "pcd"] = "ply"
    """Format of the point clouds, binary: PLY, or PCD of the Point Cloud Library."""
    elevations_deg: tuple[Number, ...] | None = None
    """Degrees above the lidar's x-y plane, one a ring, rising; left out, as all that follows: the
    device's."""
    firings: Annotated[int, Field(strict=True)] | None = None
    """Firings of all rings in a revolution; 1800 are 0.2° apart."""
    rate_hz: Rate | None = None
    """Revolutions a second, each with a cloud; left out: the device's, and a cloud at each step."""
    range_min_m: Level | None = None
    """Meters; nearer hits give no point."""
    range_max_m: Positive | None = None
    """Meters; farther hits give no point."""
    sigma_m: Level | None = None
    """Standard deviation of a range in meters."""
    step_m: Level | None = None
    """Meters that ranges are rounded to; 0: not at all."""

    def sensor(self, folder: Path, source: str) -> MountedSensor:
        """Mount the lidar."""
        names = [field.name for field in dataclasses.fields(SpinningLidar)]
        given = {name: getattr(self, name) for name in names if getattr(self, name) is not None}
        try:
            lidar = dataclasses.replace(DEVICES[self.device](), **given)
        except OpticsError as reason:
            fault = str(reason).partition("\n")[0].removeprefix("lidar.")
            raise RobotFileError(f"{source}: {fault}") from None
        lidar = lidar if self.noise else lidar.without_noise()
        return MountedLidar(
            self.type, self.name, self.hides, lidar, self.base_from_mount, self.file_format
        )


class LidarInstrument(RendererInstrument[LidarRenderer]):
    """Takes a lidar's point clouds.

    Args:
        renderer: closed with the instrument.
        file_format: of the clouds.
    """

    def __init__(self, renderer: LidarRenderer, file_format: str):
        super().__init__(renderer)
        self._file_format = file_format

    def measure(self, moment: Moment) -> LidarMeasurement:
        """Take the cloud of the revolution that ends at a moment."""
        cloud = self._renderer.scan(moment.motion, moment.time_s, moment.number)
        return LidarMeasurement(cloud, self._file_format)


@dataclass(frozen=True, eq=False)
class LidarMeasurement(Measurement):
    """Point cloud of a lidar.

    Attributes:
        cloud: with its poses.
        file_format: "ply" or "pcd".
    """

    cloud: PointCloud
    file_format: str

    def save(self, stem: Path) -> None:
        """Write the cloud where it is missing.

        Raises:
            OutputError: the file cannot be written.
        """
        target = stem.with_suffix(f".{self.file_format}")
        if not is_written(target):
            self.cloud.save(target)
