"""Keys that all sensors share in a robot file: type, name, mount and timing."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, TypeVar

from pydantic import Field

from omnisim.core.errors import OpticsError, RobotFileError
from omnisim.core.files.parameters import Coordinate, Level, Number
from omnisim.rendering.camera.sensor_file import MountingTable
from omnisim.sensors.sensor import MountedSensor
from omnisim.sensors.sensor_names import Name, SensorName

Rate = Annotated[Number, Field(ge=1e-3, le=1e5)]

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    DeviceT = TypeVar("DeviceT", bound=DataclassInstance)


class SensorMount(MountingTable):
    """Keys of all sensors."""

    sensor_class: ClassVar[type[MountedSensor]]

    type: str
    """Type of sensor."""
    name: SensorName
    """Unique name of the sensor and of its folder in a run."""
    position_m: tuple[Coordinate, Coordinate, Coordinate]
    """Position in meters, base frame: of a camera's effective viewpoint or a scan's origin."""
    hides: tuple[Name, ...] = ()
    """Nodes of the body that are invisible to this sensor, such as its own housing."""
    rate_hz: Rate | None = None
    """Measurements per second from the start of the drive. Default: one per step of the drive."""
    phase_s: Level = 0.0
    """Seconds from the start of the drive to the first measurement, with `rate_hz`."""
    jitter_s: Level = 0.0
    """Standard deviation of the measurement times in seconds, at most 8 % of the period."""
    trigger: Name | None = None
    """Name of a trigger: its sensors fire together, at the rate that one of them sets."""

    def sensors(self, folder: Path, source: str) -> tuple[MountedSensor, ...]:
        """Build the sensors of the table, usually one; see `sensor`."""
        return (self.sensor(folder, source),)

    def sensor(self, folder: Path, source: str) -> MountedSensor:
        """Build the sensor.

        Args:
            folder: folder of the robot file, the base of relative paths.
            source: name of file and sensor in messages.

        Raises:
            RobotFileError: the sensor is invalid, or a file is missing.
            SensorFileError: a sensor file is invalid; names file, key, actual and expected value.
        """
        try:
            parameters = self.parameters()
        except OpticsError as reason:
            fault = re.sub(r"^\w+\.", "", str(reason).partition("\n")[0])
            raise RobotFileError(f"{source}: {fault}") from None
        return self.sensor_class(
            self.type, self.name, self.hides, parameters, self.base_from_mount, **self.settings()
        )

    def parameters(self) -> Any:
        """Build the sensor's parameters from the table.

        Raises:
            OpticsError: the parameters are invalid.
        """
        raise NotImplementedError

    def settings(self) -> dict[str, Any]:
        """Fields of the mounted sensor besides the parameters."""
        return {}

    def overriding(self, device: DeviceT) -> DeviceT:
        """Parameters of a device, overridden by the values that the table gives."""
        given = {key.name: getattr(self, key.name, None) for key in dataclasses.fields(device)}
        given = {key: value for key, value in given.items() if value is not None}
        return dataclasses.replace(device, **given)
