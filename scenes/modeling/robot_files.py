"""Dimensions from a robot's own files, for a body that matches them."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from omnisim.cameras.mirrors import HyperbolicMirror
from omnisim.rendering.camera.sensor_file import read_sensor_file


def read_robot(folder: Path) -> tuple[dict[str, Any], dict[str, Any], HyperbolicMirror]:
    """The robot's table, its sensors by name, and the mirror of its omnidirectional camera."""
    robot = tomllib.loads((folder / "robot.toml").read_text(encoding="utf-8"))
    sensors = {sensor["name"]: sensor for sensor in robot["sensors"]}
    settings = read_sensor_file(folder / sensors["omnicam"]["file"])
    return robot, sensors, settings.model.mirror
