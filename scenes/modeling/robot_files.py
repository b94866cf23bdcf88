"""Dimensions from a robot's own files, for a body that matches them."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from omnisim.cameras import HyperbolicCamera
from omnisim.cameras.mirrors import HyperbolicMirror
from omnisim.rendering.camera.omnicamera import OmniCamera


def read_robot(folder: Path) -> tuple[dict[str, Any], dict[str, Any], HyperbolicMirror]:
    """The robot's table, its sensors by name, and the mirror of its omnidirectional camera."""
    robot = tomllib.loads((folder / "robot.toml").read_text(encoding="utf-8"))
    sensors = {sensor["name"]: sensor for sensor in robot["sensors"]}
    model = OmniCamera.from_file(folder / sensors["omnicam"]["file"]).model
    assert isinstance(model, HyperbolicCamera)
    return robot, sensors, model.mirror
