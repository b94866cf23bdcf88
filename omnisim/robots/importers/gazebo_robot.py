"""Import of a Gazebo model as a robot: sensors, wheels, and the model itself as the body.

Cameras become `omnicamera` with a sensor file each, depth cameras `depth_camera`, and IMUs `imu`.
Lidars become `lidar`, or `usarsim_range_scanner` if they have a single ring. Notices list all
unsupported parts.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from omnisim.cameras.calibration.formats.format import error_context
from omnisim.cameras.calibration.formats.gazebo import UnsupportedLensError, read_lens
from omnisim.core.arrays import Floats
from omnisim.core.errors import OmnisimError, RobotFileError, SceneError, did_you_mean
from omnisim.core.poses import pose_from_rotation, rotation_from_yaw
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.camera.quality import DEFAULT_NEAR_M
from omnisim.robots.importers.imported_robot import (
    ImportedRobot,
    ImportedSensor,
    drive_table,
    footprint,
    is_wheel_drive,
    load_body,
)
from omnisim.scene.formats.features import part_notices, xml_parts
from omnisim.scene.formats.imported_scene import Omissions, unique_name
from omnisim.scene.formats.resources import ResourcePath
from omnisim.scene.formats.sdf.models import (
    Model,
    ModelLibrary,
    PlacedModel,
    placed_models,
    read_root,
)
from omnisim.scene.formats.xml.element import XmlElement
from omnisim.sensors.depth_camera.depth_camera import MAX_RANGE_M
from omnisim.sensors.sensor_table import folder_name

_GROUND_M = 0.02  # maximum height of the body's lowest point above or below the ground


def import_model(
    path: Path, name: str | None = None, resources: Sequence[str | Path] = ()
) -> ImportedRobot:
    """Import a model from a file of a world or a model; without a name, the only one with sensors.

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
        about_drive: list[str] = []  # notices that follow all others
        elements = (placed.model.element for placed in placed_models(model))
        plugins = (plugin for element in elements for plugin in element.children("plugin"))
        plugin, kinematics = next(filter(is_wheel_drive, plugins), None), None
        if plugin is None:
            about_drive.append("kinematics: left out: no plugin for a differential drive")
        else:
            kinematics = drive_table(plugin, about_drive)
    except (SceneError, RobotFileError) as reason:
        raise RobotFileError(f"{path}: {reason}") from None
    notices = [*library.notices, *(notice for sensor in sensors for notice in sensor.notices)]
    notices += omissions.notices
    body = load_body(path, resources, notices) if whole is tree else None
    if body is not None:
        lowest_m = float(body.bounds_m()[0, 2])
        if abs(lowest_m) > _GROUND_M:
            notices.append(
                f"its lowest point is {lowest_m:.3g} m above its origin: expected 0, the ground"
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
    with_sensors = [model for model in models.values() if next(_elements(model), None)]
    candidates = with_sensors or list(models.values())
    if len(candidates) != 1:
        names = ", ".join(candidate.name for candidate in candidates) or "no model"
        raise RobotFileError(f"expected --class with the name of one model, got {names}")
    return candidates[0]


def _elements(model: Model) -> Iterator[tuple[PlacedModel, XmlElement, XmlElement]]:
    """`<sensor>` elements of a model and of those in it, each with its model and its link."""
    for placed in placed_models(model):
        for link in placed.model.element.children("link"):
            for sensor in link.children("sensor"):
                yield placed, link, sensor


def _sensors(model: Model, omissions: Omissions) -> list[ImportedSensor]:
    used_names: set[str] = set()
    return [
        found._replace(name=unique_name(folder_name(found.name), used_names))
        for placed, link, sensor in _elements(model)
        for found in read_sensors(sensor, placed.pose_of(sensor, link.name), omissions)
    ]


# Sensors of Gazebo models as tables of a robot file.

_CAMERAS = ("camera", "wideanglecamera", "wide_angle_camera", "multicamera")
_DEPTH = ("depth", "depth_camera")
_RGBD = ("rgbd", "rgbd_camera")
_LIDARS = ("lidar", "gpu_lidar", "ray", "gpu_ray")
_TABLES = {  # of features, by type of sensor
    **dict.fromkeys((*_CAMERAS, *_DEPTH, *_RGBD), "camera"),
    **dict.fromkeys(_LIDARS, "lidar"),
    "imu": "imu",
}


def read_sensors(
    sensor: XmlElement, base_from_sensor: Floats, omissions: Omissions
) -> Iterator[ImportedSensor]:
    """Convert a `<sensor>` to sensors; unsupported types, parts and lenses are omissions."""
    kind, name = sensor.attribute("type"), sensor.name or "sensor"
    try:
        rate_hz = sensor.number("update_rate", 0.0)
        rate = {"rate_hz": rate_hz} if rate_hz > 0.0 else {}
        if kind in _CAMERAS or kind in _RGBD:
            for camera in sensor.children("camera"):
                title = camera.name if kind == "multicamera" and camera.name else name
                try:
                    yield _camera(title, camera, base_from_sensor @ camera.pose(), rate)
                except UnsupportedLensError as reason:
                    omissions.add(f"camera {title}: left out: {reason}")
        if kind in _DEPTH or kind in _RGBD:
            for camera in sensor.children("camera"):
                title = f"{name}_depth" if kind in _RGBD else name
                yield _depth_camera(title, camera, base_from_sensor @ camera.pose(), rate)
        if kind in _LIDARS:
            scan = sensor.find("lidar") or sensor.find("ray")
            if scan is not None:
                yield _lidar(name, scan, base_from_sensor, rate)
        if kind == "imu":
            yield ImportedSensor.at(name, "imu", base_from_sensor, {"device": "ideal"} | rate)
        table = _TABLES.get(kind)
        if table is None:
            omissions.count(f"{kind or 'sensor'}: left out", "sensor")
        for notice in part_notices(table, xml_parts(sensor.element, table)) if table else ():
            omissions.add(notice)
    except OmnisimError as reason:
        raise RobotFileError(str(reason)) from None


def _camera(
    name: str, camera: XmlElement, base_from_camera: Floats, rate: dict[str, float]
) -> ImportedSensor:
    with error_context(camera.place):
        lens = read_lens(camera.element, camera.place)
    noise = camera.number("noise/stddev", 0.0)
    notices = (f"{name}: noise of {noise:g} is left out",) if noise > 0.0 else ()
    near_m = camera.positive("clip/near", DEFAULT_NEAR_M)
    sensor = OmniCamera(
        lens, polygons=None, near_m=near_m, far_m=camera.positive("clip/far", math.inf)
    )
    return ImportedSensor.at(name, "omnicamera", base_from_camera, rate, sensor, notices)


def _depth_camera(
    name: str, camera: XmlElement, base_from_camera: Floats, rate: dict[str, float]
) -> ImportedSensor:
    """Depth camera without holes and depth errors, because Gazebo simulates neither."""
    width, height = (round(camera.positive(f"image/{key}", 320.0)) for key in ("width", "height"))
    half_rad = 0.5 * camera.number("horizontal_fov", 1.047)
    if not 0.0 < half_rad < 0.5 * math.pi:
        raise camera.error("a <horizontal_fov> between 0 and π", 2.0 * half_rad)
    values = {
        "noise": False,
        "width_px": width,
        "height_px": height,
        "focal_length_px": 0.5 * width / math.tan(half_rad),
        "baseline_m": 1e-4,  # hardly any shadows
        "range_min_m": camera.positive("clip/near", 0.1),
        "range_max_m": min(camera.positive("clip/far", 100.0), MAX_RANGE_M),
        "max_incidence_deg": 90.0,
        **rate,
    }
    return ImportedSensor.at(name, "depth_camera", base_from_camera, values)


def _lidar(
    name: str, scan: XmlElement, base_from_lidar: Floats, rate: dict[str, float]
) -> ImportedSensor:
    """Lidar with full revolutions, or a planar scanner if there is a single ring."""
    across, low, high = _angles(scan, "horizontal")
    rings, bottom, top = _angles(scan, "vertical")
    nearest, farthest = scan.number("range/min", 0.0), scan.positive("range/max", 100.0)
    sigma_m = scan.number("noise/stddev", 0.0)
    step_rad = (high - low) / max(across - 1, 1)
    if rings == 1:
        middle = pose_from_rotation(rotation_from_yaw(0.5 * (low + high)), np.zeros(3))
        values: dict[str, Any] = {
            "scan_fov_rad": high - low,
            "resolution_rad": step_rad,
            "min_range_m": nearest,
            "max_range_m": farthest,
            "noise_share": 0.0,
            **rate,
        }
        notices = (f"{name}: noise of {sigma_m:g} m is left out",) if sigma_m > 0.0 else ()
        pose = base_from_lidar @ middle
        return ImportedSensor.at(name, "usarsim_range_scanner", pose, values, None, notices)
    values = {
        "elevations_deg": np.degrees(np.linspace(bottom, top, rings)).round(9).tolist(),
        "firings": max(round(2.0 * math.pi / step_rad), 8) if step_rad > 0.0 else 8,
        **rate,
        "range_min_m": nearest,
        "range_max_m": farthest,
        "sigma_m": sigma_m,
        "step_m": scan.number("range/resolution", 0.0),
    }
    notices = ()
    if high - low < 2.0 * math.pi - 2.0 * step_rad:
        notices = (f"{name}: {math.degrees(high - low):.4g}° wide, becomes 360° wide",)
    return ImportedSensor.at(name, "lidar", base_from_lidar, values, None, notices)


def _angles(scan: XmlElement, axis: str) -> tuple[int, float, float]:
    """Number of samples, and the first and last angle in radians."""
    path = f"scan/{axis}"
    samples = round(scan.positive(f"{path}/samples", 640.0 if axis == "horizontal" else 1.0))
    low, high = scan.number(f"{path}/min_angle", 0.0), scan.number(f"{path}/max_angle", 0.0)
    if (element := scan.find(path)) is not None and samples > 1 and not low < high:
        raise element.error("min_angle below max_angle", f"{low:g} and {high:g}")
    return samples, low, high
