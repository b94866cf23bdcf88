"""Import of a Gazebo model as a robot: sensors, wheels, and the model itself as the body.

Cameras become `omnicamera` with a sensor file each, depth cameras `depth_camera`, and IMUs `imu`.
Lidars become `lidar`, or `usarsim_range_scanner` if they have a single ring. Notices list all
unsupported parts.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from omnisim.core.errors import RobotFileError, SceneError, did_you_mean
from omnisim.robots.importers.gazebo.drive_plugins import drive_table, is_wheel_drive
from omnisim.robots.importers.gazebo.sensor_tables import read_sensors
from omnisim.robots.importers.imported_robot import (
    ImportedRobot,
    ImportedSensor,
    footprint,
    load_body,
)
from omnisim.scene.formats.imported_scene import Omissions
from omnisim.scene.formats.resources import ResourcePath
from omnisim.scene.formats.sdf.models import (
    Model,
    ModelLibrary,
    placed_models,
    read_root,
    unique_name,
)
from omnisim.sensors.sensor_names import folder_name

_GROUND_M = 0.02  # maximum height of the body's lowest point above or below the ground


def import_model(
    path: Path, name: str | None = None, resources: Sequence[str | Path] = ()
) -> ImportedRobot:
    """Import a model from a file.

    Args:
        path: file of a world or a model.
        name: name of the model; None: the only model with sensors.
        resources: folders of included models.

    Raises:
        RobotFileError: the model is missing, or a value is invalid.
    """
    try:
        library = ModelLibrary(ResourcePath(path, resources), Omissions())
        root = read_root(path)
        world = root.find("world")
        tree = library.tree(world or root, "")
        model = _choose(tree, name)
        # a model alone in its file shares that file's frame, and so does its body
        whole = tree if world is None and len(tree.models) == 1 else model
        omissions = Omissions()
        sensors = _sensors(whole, omissions)
        about_drive: list[str] = []
        kinematics = _kinematics(model, about_drive)
    except SceneError as reason:
        raise RobotFileError(f"{path}: {reason}") from None
    except RobotFileError as reason:
        raise RobotFileError(f"{path}: {reason}") from None
    notices = [*library.notices, *(notice for one in sensors for notice in one.notices)]
    notices += omissions.notices
    body = load_body(path, resources, notices) if whole is tree else None
    if body is not None:
        lowest_m = float(body.bounds_m()[0, 2])
        if abs(lowest_m) > _GROUND_M:
            notices.append(
                f"its lowest point is {lowest_m:.3g} m above its origin: expected the ground"
            )
    elif whole is not tree:
        notices.append(f"body: left out: {model.name!r} is one of several models of its file")
    notices += about_drive
    return ImportedRobot(
        name=model.name,
        source=path,
        section=f"Model {model.name!r}",
        sensors=sensors,
        notices=tuple(notices),
        comments=notices,
        body=body,
        resources=() if body is None else library.used_folders(root),
        footprint=None if body is None else footprint(body, np.zeros(3)),
        kinematics=kinematics,
    )


def _choose(tree: Model, name: str | None) -> Model:
    models = {model.name: model for model in tree.models}
    if name is not None:
        if name not in models:
            raise RobotFileError(f"no model {name!r}; {did_you_mean(name, models, 'it has')}")
        return models[name]
    candidates = [one for one in models.values() if _has_sensors(one)] or list(models.values())
    if len(candidates) != 1:
        names = ", ".join(one.name for one in candidates) or "no model"
        raise RobotFileError(f"expected --class with the name of one model, got {names}")
    return candidates[0]


def _has_sensors(model: Model) -> bool:
    return any(
        True
        for placed in placed_models(model)
        for link in placed.model.element.children("link")
        for _ in link.children("sensor")
    )


def _sensors(model: Model, omissions: Omissions) -> list[ImportedSensor]:
    """Sensors with unique names and their poses in the base."""
    sensors: list[ImportedSensor] = []
    used_names: set[str] = set()
    for placed in placed_models(model):
        for link in placed.model.element.children("link"):
            for sensor in link.children("sensor"):
                pose = placed.pose_of(sensor, link.name)
                for one in read_sensors(sensor, pose, omissions):
                    name = unique_name(folder_name(one.name), used_names)
                    sensors.append(one._replace(name=name))
    return sensors


def _kinematics(model: Model, notices: list[str]) -> dict[str, Any] | None:
    """Kinematics of the first plugin that drives two or four wheels, or None."""
    for placed in placed_models(model):
        for plugin in placed.model.element.children("plugin"):
            if is_wheel_drive(plugin):
                return drive_table(plugin, notices)
    notices.append("kinematics: left out: no plugin of a differential drive")
    return None
