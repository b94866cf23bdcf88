"""Registry of sensors, by the `type` of their tables in a robot file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

from omnisim.core.errors import RobotFileError, did_you_mean
from omnisim.core.files.parameters import parse_table
from omnisim.sensors.depth_camera.mounted_depth_camera import DepthCameraMount
from omnisim.sensors.imu.mounted_imu import ImuMount
from omnisim.sensors.laser_scanner.mounted_scanner import Lms200Mount, RangeScannerMount
from omnisim.sensors.lidar.mounted_lidar import LidarMount
from omnisim.sensors.omnicamera.calibrated_cameras import SENSOR_FILE, CalibratedCamerasMount
from omnisim.sensors.omnicamera.mounted_omnicamera import OmniCameraMount
from omnisim.sensors.range_sensor.mounted_range_sensor import InfraredMount, SonarMount
from omnisim.sensors.sensor_mount import SensorMount

MOUNT_TYPES: dict[str, type[SensorMount]] = {
    "omnicamera": OmniCameraMount,
    "lms200": Lms200Mount,
    "usarsim_range_scanner": RangeScannerMount,
    "imu": ImuMount,
    "depth_camera": DepthCameraMount,
    "lidar": LidarMount,
    "usarsim_sonar": SonarMount,
    "usarsim_ir_sensor": InfraredMount,
}


class SensorTables(Protocol):
    """Robot file with the tables of its sensors."""

    @property
    def sensors(self) -> Sequence[Mapping[str, Any]]:
        """Tables of the sensors, in the order of the file."""

    @property
    def source(self) -> str:
        """Name of the file in messages."""


def parse_mounts(robot: SensorTables) -> tuple[SensorMount, ...]:
    """Parse the tables of a robot's sensors.

    Raises:
        RobotFileError: an unknown type or key, an invalid value, or a repeated name.
    """
    mounts: list[SensorMount] = []
    for index, table in enumerate(robot.sensors):
        name, kind = table.get("name"), table.get("type")
        where = sensor_source(robot, name if isinstance(name, str) else index)
        if _has_calibration(table):
            typed = {"type": "omnicamera", **table}
            mounts.append(parse_table(typed, CalibratedCamerasMount, RobotFileError, where))
            continue
        if "type" not in table:
            raise RobotFileError(
                f"{where}: type: missing; expected one of {', '.join(MOUNT_TYPES)}"
            )
        if not isinstance(kind, str) or kind not in MOUNT_TYPES:
            hint = did_you_mean(str(kind), MOUNT_TYPES)
            raise RobotFileError(f"{where}: type = {kind!r}: unknown sensor type; {hint}")
        mount = parse_table(table, MOUNT_TYPES[kind], RobotFileError, where)
        if any(mount.name == other.name for other in mounts):
            raise RobotFileError(f"{where}: a second sensor of this name: expected each name once")
        mounts.append(mount)
    return tuple(mounts)


def _has_calibration(table: Mapping[str, Any]) -> bool:
    """True if the table refers to a calibration file with its cameras."""
    file = table.get("file")
    is_calibration = isinstance(file, str) and Path(file).suffix.lower() not in ("", SENSOR_FILE)
    return is_calibration and table.get("type", "omnicamera") == "omnicamera"


def sensor_source(robot: SensorTables, sensor: str | int) -> str:
    """Name of a robot's sensor in messages, from its name or index."""
    where = f"sensor {sensor!r}" if isinstance(sensor, str) else f"sensors.{sensor}"
    return f"{robot.source}: {where}"
