"""Robots imported from other simulators: their mechanics, and the robot files written from them."""

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
from omnisim.scene.formats.features import part_notices, xml_parts
from omnisim.scene.formats.xml.element import XmlElement
from omnisim.scene.space.enclosure import enclosing_nodes
from omnisim.sensors.sensor_table import folder_name

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
        return {sensor.name: sensor.camera for sensor in self.sensors if sensor.camera is not None}

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
            _commented(sensor.comments) | keys
            for sensor, keys in zip(self.sensors, table["sensors"], strict=True)
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
                table["resources"] = [
                    os.path.relpath(resource, folder) for resource in self.resources
                ]
        table |= {
            "footprint": self.footprint,
            "kinematics": self.kinematics,
            "physics": self.physics,
            "sensors": [self._sensor_table(sensor, files) for sensor in self.sensors],
        }
        return {key: value for key, value in table.items() if value is not None}

    def _sensor_table(self, sensor: ImportedSensor, files: Mapping[str, str]) -> dict[str, Any]:
        table: dict[str, Any] = {"name": sensor.name, "type": sensor.type}
        place = [round(float(value), 9) + 0.0 for value in sensor.position_m - self.base_m]
        roll, pitch, yaw = (round(float(angle), 9) + 0.0 for angle in sensor.angles_deg)
        table |= {"position_m": place, "roll_deg": roll, "pitch_deg": pitch, "yaw_deg": yaw}
        table |= sensor.values
        if sensor.name in files:
            table["file"] = files[sensor.name]
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


# Robots of models that state wheels on joints and masses instead of a drive.


CLEARANCE = 0.25  # ground clearance as a share of the wheel diameter


class Mechanics(NamedTuple):
    """Mechanics and sensors of a robot model in its rest pose, in the file's frame."""

    name: str  # name of the model
    wheels: Sequence[Wheel]  # wheels on joints about y
    mass_kg: float  # total mass; 0: unknown
    center_m: Floats  # (3,) center of mass
    sensors: Sequence[ImportedSensor]  # sensors with unique names
    limits: dict[str, float]  # limits that the model states, with the keys of `[kinematics]`


def imported_robot(
    mechanics: Mechanics,
    source: Path,
    body: Scene | None,
    resources: Sequence[Path],
    notices: list[str],
) -> ImportedRobot:
    """Convert a model to a robot whose base is on the ground, centered between its wheels.

    The body is in the file's frame; notices about the drive and the sensors are appended to
    `notices`.
    """
    drive = drive_of(mechanics.wheels, notices)
    base_m = np.zeros(3)
    if drive is not None:
        base_m = drive.base_m
    elif body is not None:
        base_m[2] = body.bounds_m()[0, 2]
    base_m = np.round(base_m, 6) + 0.0
    size = None if body is None else footprint(body, base_m)
    kinematics, physics = None, None
    if drive is not None:
        if size is not None:
            clearance_m = round(CLEARANCE * drive.table["wheel_diameter_m"], 6)
            size["clearance_m"] = min(clearance_m, round(0.5 * size["height_m"], 6))
        speed = {"max_speed_mps": drive.speed_mps} if drive.speed_mps > 0.0 else {}
        kinematics = drive.table | _all_limits(speed | mechanics.limits, notices)
    if mechanics.mass_kg > 0.0:
        physics = {"mass_kg": round(mechanics.mass_kg, 6)}
        height_m = round(float(mechanics.center_m[2] - base_m[2]), 6)
        if height_m > 1e-3:
            physics["center_height_m"] = height_m
    notices += [notice for sensor in mechanics.sensors for notice in sensor.notices]
    return ImportedRobot(
        name=mechanics.name,
        source=source,
        section=f"Model {mechanics.name!r}",
        sensors=mechanics.sensors,
        notices=tuple(notices),
        comments=notices,
        body=body,
        resources=resources,
        base_m=base_m,
        kinematics=kinematics,
        footprint=size,
        physics=physics,
    )


ACROSS_COSINE = 0.9  # minimum cosine between a wheel's axis and y
GROUND_SHARE = 0.25  # maximum height of a wheel's lowest point above the ground, in radii


class Wheel(NamedTuple):
    """Wheel of a model in its rest pose."""

    name: str  # name of the wheel's joint
    middle_m: Floats  # (3,) center of the tire, in the file's frame
    radius_m: float  # radius of the tire
    speed_radps: float = 0.0  # maximum speed that the joint states; 0: unstated

    @property
    def lowest_m(self) -> float:
        """Height of the wheel's lowest point."""
        return float(self.middle_m[2]) - self.radius_m


class WheelDrive(NamedTuple):
    """Drive of a robot whose wheels turn in pairs."""

    base_m: Floats  # (3,) point on the ground, centered between the wheels, in the file's frame
    table: dict[str, Any]  # keys of `[kinematics]` without the limits
    speed_mps: float  # maximum speed from the joints' limits; 0: unstated


def is_across(axis: Floats) -> bool:
    """True if an axis (3,) points left or right."""
    return bool(abs(axis[1]) > ACROSS_COSINE * np.linalg.norm(axis))


def drive_of(wheels: Sequence[Wheel], notices: list[str]) -> WheelDrive | None:
    """Drive of the wheels on the ground; None, with a notice, if they do not form pairs."""
    ground_m = min((wheel.lowest_m for wheel in wheels), default=0.0)
    standing = [
        wheel for wheel in wheels if wheel.lowest_m - ground_m < GROUND_SHARE * wheel.radius_m
    ]
    middles = np.array([wheel.middle_m for wheel in standing]).reshape(-1, 3)
    middle_m = 0.5 * (middles.min(axis=0) + middles.max(axis=0)) if standing else np.zeros(3)
    is_left = middles[:, 1] > middle_m[1]
    if not standing or np.ptp(middles[:, 1]) < 1e-3 or 2 * is_left.sum() != len(standing):
        names = ", ".join(wheel.name for wheel in standing) or "none"
        notices.append(
            "kinematics: left out: expected wheels in pairs, left and right, on joints about y "
            f"without limits, got {names}"
        )
        return None
    wheelbase_m = float(np.ptp(middles[:, 0]))
    if len(standing) > 4:
        notices.append(f"drives on four wheels: the outermost of its {len(standing)}")
    radius_m = float(np.mean([wheel.radius_m for wheel in standing]))
    track_m = float(middles[is_left, 1].mean() - middles[~is_left, 1].mean())
    table = {
        "type": "differential" if len(standing) == 2 else "skid_steer",
        "track_m": round(track_m, 6),
        **({"wheelbase_m": round(wheelbase_m, 6)} if len(standing) > 2 else {}),
        "wheel_diameter_m": round(2.0 * radius_m, 6),
    }
    base_m = np.array((middle_m[0], middle_m[1], ground_m))
    return WheelDrive(base_m, table, min(wheel.speed_radps for wheel in standing) * radius_m)


# Gazebo's drive plugins for wheeled robots, as tables of a robot file.

_SKIDS = "skid_steer"
_PLUGINS = ("diff-drive", "diff_drive", "DiffDrive", _SKIDS)
# Key, element of the plugin, default in the plugin's unit, factor from its unit to the key's.
_LIMITS = (
    ("max_speed_mps", "max_linear_velocity", 1.0, 1.0),
    ("max_turn_rate_degps", "max_angular_velocity", np.radians(90.0), np.degrees(1.0)),
    ("max_acceleration_mps2", "max_linear_acceleration", 1.0, 1.0),
    ("max_turn_acceleration_degps2", "max_angular_acceleration", np.pi, np.degrees(1.0)),
)


def is_wheel_drive(plugin: XmlElement) -> bool:
    """True for a plugin that drives a robot on two or four wheels."""
    names = plugin.attribute("filename") + plugin.attribute("name")
    return any(word in names for word in _PLUGINS)


def drive_table(plugin: XmlElement, notices: list[str]) -> dict[str, Any]:
    """Convert a drive plugin to a `[kinematics]` table."""
    notices += part_notices("drive", xml_parts(plugin.element, "drive"))
    wheel_m = 2.0 * plugin.number("wheel_radius", 0.0)
    wheel_m = wheel_m or plugin.number("wheel_diameter", plugin.number("wheelDiameter", 0.0))
    track_m = plugin.number("wheel_separation", plugin.number("wheelSeparation", 0.0))
    skids = _SKIDS in plugin.attribute("filename") + plugin.attribute("name")
    return {
        "type": "skid_steer" if skids else "differential",
        "track_m": track_m if track_m > 0.0 else None,
        "wheel_diameter_m": wheel_m if wheel_m > 0.0 else None,
        **_all_limits(stated_limits(plugin), notices),
    }


def stated_limits(plugin: XmlElement) -> dict[str, float]:
    """Limits that a plugin states, in the units of a robot file."""
    stated = {key: plugin.number(path, 0.0) * scale for key, path, _, scale in _LIMITS}
    return {key: value for key, value in stated.items() if value > 0.0}


def _all_limits(stated: Mapping[str, float], notices: list[str]) -> dict[str, float]:
    """Complete the stated limits with assumed defaults, which a notice lists."""
    assumed = {key: default * scale for key, _, default, scale in _LIMITS if key not in stated}
    if assumed:
        listed = ", ".join(f"{key} = {value:g}" for key, value in assumed.items())
        notices.append(f"not stated, but assumed: {listed}")
    return {key: round(float({**assumed, **stated}[key]), 9) for key, *_ in _LIMITS}
