"""Registry of sensors, by the `type` of their tables in a robot file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

from omnisim.core.errors import RobotFileError, did_you_mean
from omnisim.core.files.parameters import parse_table
from omnisim.sensors.depth_camera.depth_camera import DepthCameraTable
from omnisim.sensors.imu.imu import ImuTable
from omnisim.sensors.laser_scanner.laser_scanner import Lms200Table, RangeScannerTable
from omnisim.sensors.lidar.spinning_lidar import LidarTable
from omnisim.sensors.omnicamera.camera_tables import CalibratedCamerasTable, OmniCameraTable
from omnisim.sensors.range_sensor.range_sensor import InfraredTable, SonarTable
from omnisim.sensors.sensor_table import SensorTable

SENSOR_TYPES: dict[str, type[SensorTable]] = {
    "omnicamera": OmniCameraTable,
    "lms200": Lms200Table,
    "usarsim_range_scanner": RangeScannerTable,
    "imu": ImuTable,
    "depth_camera": DepthCameraTable,
    "lidar": LidarTable,
    "usarsim_sonar": SonarTable,
    "usarsim_ir_sensor": InfraredTable,
}


class SensorTables(Protocol):
    """Robot file with the tables of its sensors."""

    @property
    def sensors(self) -> Sequence[Mapping[str, Any]]:
        """Tables of the sensors, in the order of the file."""

    @property
    def source(self) -> str:
        """Name of the file in messages."""


def parse_sensors(robot: SensorTables) -> tuple[SensorTable, ...]:
    """Parse the tables of a robot's sensors.

    Raises:
        RobotFileError: an unknown type or key, an invalid value, or a repeated name.
    """
    tables: list[SensorTable] = []
    for index, table in enumerate(robot.sensors):
        name, kind = table.get("name"), table.get("type")
        where = sensor_source(robot, name if isinstance(name, str) else index)
        file = table.get("file")
        suffix = Path(file).suffix.lower() if isinstance(file, str) else ""
        if suffix not in ("", ".toml") and table.get("type", "omnicamera") == "omnicamera":
            typed = {"type": "omnicamera", **table}
            tables.append(parse_table(typed, CalibratedCamerasTable, RobotFileError, where))
            continue  # the names of its cameras are in the calibration file
        if "type" not in table:
            raise RobotFileError(
                f"{where}: type: missing; expected one of {', '.join(SENSOR_TYPES)}"
            )
        if not isinstance(kind, str) or kind not in SENSOR_TYPES:
            hint = did_you_mean(str(kind), SENSOR_TYPES)
            raise RobotFileError(f"{where}: type = {kind!r}: unknown sensor type; {hint}")
        parsed = parse_table(table, SENSOR_TYPES[kind], RobotFileError, where)
        if any(parsed.name == other.name for other in tables):
            raise RobotFileError(f"{where}: a second sensor of this name: expected each name once")
        tables.append(parsed)
    return tuple(tables)


def sensor_source(robot: SensorTables, sensor: str | int) -> str:
    """Name of a robot's sensor in messages, from its name or index."""
    where = f"sensor {sensor!r}" if isinstance(sensor, str) else f"sensors.{sensor}"
    return f"{robot.source}: {where}"
