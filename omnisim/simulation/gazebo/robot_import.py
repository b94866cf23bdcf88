"""Import of a model as a robot file: sensors, wheels, and the model itself as the body.

Cameras become `omnicamera` with a sensor file each, depth cameras `depth_camera`, lidars `lidar`,
or `usarsim_range_scanner` where they have one ring, and IMUs `imu`. Everything else is named in the
notices.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from omnisim.errors import RobotFileError, SceneError, did_you_mean
from omnisim.poses import roll_pitch_yaw_from_rotation
from omnisim.robot.sensor_names import folder_name
from omnisim.scene import Scene, load_scene
from omnisim.scene.enclosure import enclosing_nodes
from omnisim.scene.resources import ResourcePath
from omnisim.scene.sdf.element import Omissions, SdfElement
from omnisim.scene.sdf.models import Model, ModelLibrary, placed_models, read_root, unique_name
from omnisim.short_repr import counted
from omnisim.simulation.gazebo.sensor_tables import ImportedSensor, read_sensors
from omnisim.toml_file import toml_text

SUFFIXES = (".sdf", ".world")
_GROUND_M = 0.02  # a body whose lowest point is as near to 0 stands on the ground


@dataclass(frozen=True)
class ImportedModel:
    """Text of a robot file and of the sensor files beside it.

    Attributes:
        name: of the model.
        text: TOML.
        sensor_files: TOML by the names of the files.
        notices: one line each.
    """

    name: str
    text: str
    sensor_files: dict[str, str]
    notices: tuple[str, ...]


def import_model(
    path: Path, output: Path, name: str | None = None, resources: Sequence[str | Path] = ()
) -> ImportedModel:
    """Import a model of a file.

    Args:
        path: a world or a model.
        output: the robot file that it is for: files that it names are relative to it.
        name: of the model; may be left out where one has sensors.
        resources: folders of models that it includes.

    Raises:
        RobotFileError: no such model, or values that are none.
    """
    try:
        library = ModelLibrary(ResourcePath(path, resources), Omissions())
        root = read_root(path)
        world = root.find("world")
        tree = library.tree(world or root, "")
        model = _choose(tree, name)
        # a model that is alone in its file has that file's frame, as its body has
        whole = tree if world is None and len(tree.models) == 1 else model
        sensors, others = _sensors(whole)
    except SceneError as reason:
        raise RobotFileError(f"{path}: {reason}") from None
    except RobotFileError as reason:
        raise RobotFileError(f"{path}: {reason}") from None
    notices = [*library.notices, *(notice for one in sensors for notice in one.notices)]
    notices += [f"{kind}: left out ({counted(n, 'sensor')})" for kind, n in others.items()]
    table: dict[str, Any] = {"name": folder_name(model.name).lower(), "title": model.name}
    body = _body(path, resources, notices) if whole is tree else None
    if body is not None:
        table["body"] = os.path.relpath(path, output.parent)
        if folders := library.used_folders(root):
            table["resources"] = [os.path.relpath(folder, output.parent) for folder in folders]
        table["footprint"] = _footprint(body, notices)
    elif whole is not tree:
        notices.append(f"body: left out: {model.name!r} is one of several models of its file")
    table["kinematics"] = _kinematics(model, notices)
    files: dict[str, str] = {}
    table["sensors"] = [_sensor_table(one, body, output.stem, files) for one in sensors]
    lines = [f"# Model {model.name!r} of {path.name}.", *(f"# {notice}" for notice in notices)]
    return ImportedModel(
        model.name, "\n".join(lines) + "\n" + toml_text(table), files, tuple(notices)
    )


def _choose(tree: Model, name: str | None) -> Model:
    models = {model.name: model for model in tree.models}
    if name is not None:
        if name not in models:
            raise RobotFileError(f"no model {name!r}; {did_you_mean(name, models, 'it has')}")
        return models[name]
    able = [one for one in models.values() if _has_sensors(one)] or list(models.values())
    if len(able) != 1:
        names = ", ".join(one.name for one in able) or "no model"
        raise RobotFileError(f"expected --class with the name of one model, got {names}")
    return able[0]


def _has_sensors(model: Model) -> bool:
    return any(
        True
        for placed in placed_models(model)
        for link in placed.model.element.children("link")
        for _ in link.children("sensor")
    )


def _sensors(model: Model) -> tuple[list[ImportedSensor], Counter[str]]:
    """Sensors with distinct names and poses in the base, and counts of other kinds."""
    found: list[ImportedSensor] = []
    others: Counter[str] = Counter()
    taken: set[str] = set()
    for placed in placed_models(model):
        for link in placed.model.element.children("link"):
            for sensor in link.children("sensor"):
                pose = placed.pose_of(sensor, link.name)
                read = list(read_sensors(sensor, pose))
                for one in read:
                    name = unique_name(folder_name(one.name), taken)
                    found.append(one._replace(name=name))
                if not read:
                    others[sensor.attribute("type") or "sensor"] += 1
    return found, others


def _sensor_table(
    sensor: ImportedSensor, body: Scene | None, stem: str, files: dict[str, str]
) -> dict[str, Any]:
    values = dict(sensor.values)
    if sensor.sensor_file:
        name = f"{stem}-{sensor.name}.toml"
        files[name] = sensor.sensor_file
        values["file"] = name
    if body is not None and values["type"] != "imu":
        # Gazebo does not draw a housing from its inside
        hides = enclosing_nodes(body, sensor.pose[:3, 3])
        values |= {"hides": hides} if hides else {}
    angles = np.degrees(roll_pitch_yaw_from_rotation(sensor.pose[:3, :3]))
    roll, pitch, yaw = (round(float(angle), 9) + 0.0 for angle in angles)
    return {
        "name": sensor.name,
        "type": values.pop("type"),
        "position_m": [round(float(value), 9) + 0.0 for value in sensor.pose[:3, 3]],
        "roll_deg": roll,
        "pitch_deg": pitch,
        "yaw_deg": yaw,
        **values,
    }


def _body(path: Path, resources: Sequence[str | Path], notices: list[str]) -> Scene | None:
    """Model as it is drawn; None, with a notice, where it cannot be."""
    try:
        return load_scene(path, resources=resources, animation="none")
    except SceneError as reason:
        notices.append(f"body: left out: {reason}")
        return None


def _footprint(body: Scene, notices: list[str]) -> dict[str, float]:
    """Footprint around the body."""
    low, high = body.bounds_m()
    if abs(low[2]) > _GROUND_M:
        notices.append(f"its lowest point is {low[2]:.3g} m above its origin: expected the ground")
    length, width = (2.0 * float(max(-low[axis], high[axis])) for axis in (0, 1))
    sizes = {"length_m": length, "width_m": width, "height_m": max(float(high[2]), 0.01)}
    return {key: round(value, 6) for key, value in sizes.items()}  # bounds are of float32


_PLUGINS = ("diff-drive", "diff_drive", "DiffDrive", "skid_steer")


def _kinematics(model: Model, notices: list[str]) -> dict[str, Any] | None:
    """Drive of a plugin for two or four wheels, or None."""
    for placed in placed_models(model):
        for plugin in placed.model.element.children("plugin"):
            names = plugin.attribute("filename") + plugin.attribute("name")
            if any(word in names for word in _PLUGINS):
                return _drive(plugin, notices)
    notices.append("kinematics: left out: no plugin of a differential drive")
    return None


def _drive(plugin: SdfElement, notices: list[str]) -> dict[str, Any]:
    wheel_m = 2.0 * plugin.number("wheel_radius", 0.0)
    wheel_m = wheel_m or plugin.number("wheel_diameter", plugin.number("wheelDiameter", 0.0))
    track_m = plugin.number("wheel_separation", plugin.number("wheelSeparation", 0.0))
    limits = {}
    for key, path, default, scale in (
        ("max_speed_mps", "max_linear_velocity", 1.0, 1.0),
        ("max_turn_rate_dps", "max_angular_velocity", np.radians(90.0), np.degrees(1.0)),
        ("max_acceleration_mps2", "max_linear_acceleration", 1.0, 1.0),
        ("max_turn_acceleration_dps2", "max_angular_acceleration", np.pi, np.degrees(1.0)),
    ):
        stated = plugin.number(path, 0.0)
        limits[key] = round(float((stated if stated > 0.0 else default) * scale), 9)
        if stated <= 0.0:
            notices.append(f"{key} is not stated: {limits[key]:g} is an assumption")
    skids = "skid_steer" in plugin.attribute("filename") + plugin.attribute("name")
    return {
        "type": "skid_steer" if skids else "differential",
        "track_m": track_m if track_m > 0.0 else None,
        "wheel_diameter_m": wheel_m if wheel_m > 0.0 else None,
        **limits,
    }
