"""Import of URDF robots: wheels by their joints, and sensors of `<gazebo>` elements."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from omnisim.core.arrays import Floats
from omnisim.core.errors import RobotFileError, SceneError
from omnisim.robots.importers.gazebo_robot import read_sensors
from omnisim.robots.importers.imported_robot import (
    ImportedRobot,
    ImportedSensor,
    Mechanics,
    Wheel,
    imported_robot,
    is_across,
    is_wheel_drive,
    load_body,
    stated_limits,
)
from omnisim.scene import Scene
from omnisim.scene.formats.features import part_notices, xml_parts
from omnisim.scene.formats.imported_scene import Omissions, unique_name
from omnisim.scene.formats.resources import ResourcePath
from omnisim.scene.formats.urdf.reader import link_poses
from omnisim.scene.formats.xml.element import XmlElement, parse_xml
from omnisim.sensors.sensor_table import folder_name

Poses = Mapping[str, Floats]  # poses (4, 4) by link name


def import_urdf(path: Path, resources: Sequence[str | Path] = ()) -> ImportedRobot:
    """Import the robot of a URDF file, with folders of referenced packages."""
    notices: list[str] = []
    try:
        root = parse_xml(path.read_bytes())
        robot = XmlElement(root, "robot", path)
        poses = link_poses(robot)
        body = load_body(path, resources, notices)
        wheels = list(_wheels(robot, poses, body))
        mass_kg, center_m = _mass(robot, poses)
        sensors = list(_sensors(robot, poses, notices))
        extensions = robot.children("gazebo")
        plugins = (plugin for extension in extensions for plugin in extension.children("plugin"))
        plugin, limits = next(filter(is_wheel_drive, plugins), None), dict[str, float]()
        if plugin is not None:
            notices += part_notices("drive", xml_parts(plugin.element, "drive"))
            limits = stated_limits(plugin)
    except OSError as reason:
        raise RobotFileError(f"{path}: cannot be read: {reason.strerror}") from None
    except (SceneError, RobotFileError) as reason:
        raise RobotFileError(f"{path}: {reason}") from None
    mechanics = Mechanics(robot.name or path.stem, wheels, mass_kg, center_m, sensors, limits)
    texts = {value for element in root.iter() for value in element.attrib.values()}
    folders = ResourcePath(path, resources).used(sorted(text for text in texts if "://" in text))
    return imported_robot(mechanics, path, body, folders, notices)


def _wheels(robot: XmlElement, poses: Poses, body: Scene | None) -> Iterator[Wheel]:
    """Wheels: links on continuous joints about y, fixed to the base."""
    moved = {
        _link(joint, "child"): _link(joint, "parent")
        for joint in robot.children("joint")
        if joint.attribute("type") == "fixed"
    }
    base = poses.keys() - {_link(joint, "child") for joint in robot.children("joint")}
    links = {link.name: link for link in robot.children("link")}
    for joint in robot.children("joint"):
        parent, child = _link(joint, "parent"), _link(joint, "child")
        while parent in moved:
            parent = moved[parent]
        if joint.attribute("type") != "continuous" or parent not in base:
            continue
        axis, along_x = joint.find("axis"), (1.0, 0.0, 0.0)
        vector = along_x if axis is None else axis.attribute_numbers("xyz", along_x, 3)
        if not is_across(poses[child][:3, :3] @ vector):
            continue
        tire = _tire(links[child], poses[child], body)
        if tire is None:
            continue
        limit = joint.find("limit")
        speed = 0.0 if limit is None else limit.attribute_numbers("velocity", (0.0,), 1)[0]
        yield Wheel(joint.name, *tire, speed)


def _link(joint: XmlElement, tag: str) -> str:
    element = joint.find(tag)
    return "" if element is None else element.attribute("link")


def _tire(link: XmlElement, pose: Floats, body: Scene | None) -> tuple[Floats, float] | None:
    """Center (3,) and radius of a wheel: of its round shape, else of its geometry's bounds."""
    for tag in ("collision", "visual"):
        for part in link.children(tag):
            geometry = part.find("geometry")
            for kind in ("cylinder", "sphere"):
                shape = None if geometry is None else geometry.find(kind)
                if shape is not None:
                    return (pose @ part.origin())[:3, 3], shape.attribute_sizes("radius")[0]
    if body is None:
        return None
    corners = [
        body.meshes[instance.mesh].positions @ instance.world_from_mesh[:3, :3].T
        + instance.world_from_mesh[:3, 3]
        for instance in body.instances
        if instance.name.startswith(f"{link.name}/")
    ]
    if not corners:
        return None
    points = np.concatenate(corners)
    low, high = points.min(axis=0), points.max(axis=0)
    return 0.5 * (low + high), float(0.5 * (high[2] - low[2]))


def _mass(robot: XmlElement, poses: Poses) -> tuple[float, Floats]:
    total_kg, moment = 0.0, np.zeros(3)
    for link in robot.children("link"):
        inertial = link.find("inertial")
        mass = None if inertial is None else inertial.find("mass")
        if inertial is None or mass is None:
            continue
        (mass_kg,) = mass.attribute_numbers("value", (0.0,), 1)
        total_kg += mass_kg
        moment += mass_kg * (poses[link.name] @ inertial.origin())[:3, 3]
    return total_kg, moment / total_kg if total_kg > 0.0 else moment


def _sensors(robot: XmlElement, poses: Poses, notices: list[str]) -> Iterator[ImportedSensor]:
    """Sensors of the `<gazebo>` elements, placed on their links; notices count the others."""
    omissions = Omissions()
    used_names: set[str] = set()
    for extension in robot.children("gazebo"):
        link = extension.attribute("reference")
        for sensor in extension.children("sensor") if link in poses else ():
            for found in read_sensors(sensor, poses[link] @ sensor.pose(), omissions):
                yield found._replace(name=unique_name(folder_name(found.name), used_names))
    notices += omissions.notices
