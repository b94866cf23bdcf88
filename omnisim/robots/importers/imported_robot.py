"""Robots imported from other simulators, and the robot files written from them."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np

from omnisim.core.arrays import Floats
from omnisim.core.errors import SceneError
from omnisim.core.files.atomic_file import write_text
from omnisim.core.files.toml_file import Comment, toml_text
from omnisim.core.poses import roll_pitch_yaw_from_rotation
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.robots.robot_file import Robot, parse_robot
from omnisim.scene import Scene, read_scene
from omnisim.scene.space.enclosure import enclosing_nodes
from omnisim.sensors.sensor_names import folder_name

_MAX_M = 1e6


class ImportedSensor(NamedTuple):
    """Sensor of a model in its rest pose."""

    name: str  # unique name of the sensor
    type: str  # sensor type in a robot file
    position_m: Sequence[float]  # (3,) in the model's frame
    angles_deg: Sequence[float]  # roll, pitch and yaw in the model's frame
    values: Mapping[str, Any] = {}  # further keys of its table in a robot file
    # lens and quality of an omnicamera; None: the paper's camera, or not an omnicamera
    camera: OmniCamera | None = None
    notices: tuple[str, ...] = ()  # one line for each omission
    comments: tuple[str, ...] = ()  # lines above its table in the robot file

    @classmethod
    def at(cls, name: str, kind: str, pose: Floats, *rest: Any) -> Self:
        """Sensor at a pose (4, 4) in the model's frame; `rest`: fields from `values` on."""
        angles_deg = np.degrees(roll_pitch_yaw_from_rotation(pose[:3, :3]))
        return cls(name, kind, pose[:3, 3].tolist(), angles_deg.tolist(), *rest)


@dataclass(frozen=True, eq=False)
class ImportedRobot:
    """Robot of a model in its rest pose; its tables have the keys of a robot file."""

    name: str  # name of the model
    source: Path  # file of the model
    section: str  # description of the model's part of the file
    sensors: Sequence[ImportedSensor]  # sensors in the file's order
    notices: tuple[str, ...]  # one line per omission or assumption
    comments: Sequence[str]  # comment lines at the head of the robot file, after the first
    body: Scene | None = None  # geometry of the model, or None
    resources: Sequence[Path] = ()  # folders of models and packages that the body references
    # (3,) position of the base, which is on the ground, in the model's frame
    base_m: Floats = field(default_factory=lambda: np.zeros(3))
    # kinematics, footprint, physics: tables of the robot file; None: unknown
    kinematics: Mapping[str, Any] | None = None
    footprint: Mapping[str, Any] | None = None
    physics: Mapping[str, Any] | None = None

    @property
    def cameras(self) -> dict[str, OmniCamera]:
        """Cameras with lenses of their own, by sensor name."""
        return {one.name: one.camera for one in self.sensors if one.camera is not None}

    def robot(self, file: Path) -> Robot:
        """Robot as read from a robot file; its cameras are in `cameras`, not in sensor files."""
        return parse_robot(self._table(file.parent), str(file), file.parent)

    def write(self, output: Path) -> None:
        """Write the sensor files, then the robot file beside them.

        Raises:
            OutputError: a file cannot be written.
        """
        for name, file in self._sensor_files(output).items():
            write_text(output.with_name(file), self.cameras[name].to_toml())
        write_text(output, self.text(output))

    def text(self, output: Path) -> str:
        """Text of the robot file at `output`; its paths are relative to the folder of `output`."""
        table = self._table(output.parent, self._sensor_files(output))
        table["sensors"] = [
            _commented(one.comments) | keys
            for one, keys in zip(self.sensors, table["sensors"], strict=True)
        ]
        head = _commented((f"{self.section} of {self.source.name}.", *self.comments))
        return toml_text(head | table)

    def _sensor_files(self, output: Path) -> dict[str, str]:
        return {name: f"{output.stem}-{name}.toml" for name in self.cameras}

    def _table(self, folder: Path, files: Mapping[str, str] = {}) -> dict[str, Any]:
        """Table of a robot file in `folder`; `files` are the sensor files' names by sensor name."""
        table: dict[str, Any] = {"name": folder_name(self.name).lower(), "title": self.name}
        if self.body is not None:
            table["body"] = os.path.relpath(self.source, folder)
            if np.any(self.base_m):
                table["body_offset_m"] = (-self.base_m + 0.0).tolist()
            if self.resources:
                table["resources"] = [os.path.relpath(one, folder) for one in self.resources]
        table |= {
            "footprint": self.footprint,
            "kinematics": self.kinematics,
            "physics": self.physics,
            "sensors": [self._sensor_table(one, files.get(one.name)) for one in self.sensors],
        }
        return {key: value for key, value in table.items() if value is not None}

    def _sensor_table(self, sensor: ImportedSensor, file: str | None) -> dict[str, Any]:
        table: dict[str, Any] = {"name": sensor.name, "type": sensor.type}
        place = [round(float(value), 9) + 0.0 for value in sensor.position_m - self.base_m]
        roll, pitch, yaw = (round(float(angle), 9) + 0.0 for angle in sensor.angles_deg)
        table |= {"position_m": place, "roll_deg": roll, "pitch_deg": pitch, "yaw_deg": yaw}
        table |= sensor.values
        if file is not None:
            table["file"] = file
        origin_m = np.array(sensor.position_m)
        # positions beyond the limit are rejected when the robot file is parsed
        if self.body is not None and sensor.type != "imu" and np.abs(origin_m).max() < _MAX_M:
            # other simulators cull the back faces of a housing around the sensor
            hides = enclosing_nodes(self.body, origin_m)
            table |= {"hides": hides} if hides else {}
        return table


def _commented(lines: Sequence[str]) -> dict[str, Any]:
    return {f"# {line}": Comment(line) for line in lines}


def load_body(path: Path, resources: Sequence[str | Path], notices: list[str]) -> Scene | None:
    """Load the model's geometry; a failure adds a notice and returns None."""
    try:
        return read_scene(path, resources=resources, animation="none")
    except SceneError as reason:
        notices.append(f"body: left out: {reason}")
        return None


def footprint(body: Scene, base_m: Floats) -> dict[str, float]:
    """Footprint table of a body, centered at the base; `base_m` (3,) is in the body's frame."""
    low, high = body.bounds_m() - base_m
    length, width = (2.0 * float(max(-low[axis], high[axis])) for axis in (0, 1))
    sizes = {"length_m": length, "width_m": width, "height_m": max(float(high[2]), 0.01)}
    return {key: round(value, 6) for key, value in sizes.items()}  # bounds are float32
