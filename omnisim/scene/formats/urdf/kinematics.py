"""Poses of a robot's links with its joints at rest."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from xml.etree.ElementTree import ParseError, iterparse

import numpy as np
import scipy  # loads its submodules on first use
from numpy.typing import NDArray

from omnisim.core.errors import SceneError
from omnisim.core.poses import pose_from_rotation
from omnisim.scene.formats.xml.element import XmlElement


def link_poses(robot: XmlElement) -> dict[str, NDArray[np.float64]]:
    """Poses (4, 4) robot_from_link by link name, in tree order from the root.

    A joint rests at 0, or at the middle of its limits if these exclude 0.

    Raises:
        SceneError: unknown or duplicate link names, or links that do not form a tree.
    """
    links = [link.name for link in robot.children("link")]
    for link in robot.children("link"):
        if links.count(link.name) > 1:
            raise link.attribute_error("name", "each link once")
    if not links:
        raise SceneError(f"{robot.place}: expected a <link>, got none")
    parents: dict[str, tuple[str, NDArray[np.float64]]] = {}
    for joint in robot.children("joint"):
        parent, child = _end(joint, "parent", links), _end(joint, "child", links)
        if child.attribute("link") in parents:
            raise child.attribute_error("link", "a link without another parent")
        pose = joint.origin() @ _motion(joint)
        parents[child.attribute("link")] = (parent.attribute("link"), pose)
    poses = {link: np.eye(4) for link in links if link not in parents}
    inner: dict[str, list[str]] = {}
    for child_name, (parent_name, _) in parents.items():
        inner.setdefault(parent_name, []).append(child_name)
    waiting = list(poses)
    while waiting:
        parent_name = waiting.pop()
        for child_name in inner.get(parent_name, ()):
            poses[child_name] = poses[parent_name] @ parents[child_name][1]
            waiting.append(child_name)
    if rest := sorted(set(links) - poses.keys()):
        raise SceneError(f"{robot.place}: link[{rest[0]}]: expected a tree of links, got a circle")
    return poses


def _end(joint: XmlElement, tag: str, links: list[str]) -> XmlElement:
    """Parent or child element of a joint, with a valid link name."""
    end = joint.find(tag)
    if end is None:
        raise SceneError(f"{joint.place}: expected a <{tag}>, got none")
    if end.attribute("link") not in links:
        raise end.attribute_error("link", "the name of a <link>")
    return end


def _motion(joint: XmlElement) -> NDArray[np.float64]:
    """Pose (4, 4) of a joint's child at rest, relative to the joint's origin."""
    kind, limit = joint.attribute("type"), joint.find("limit")
    if kind not in ("revolute", "prismatic") or limit is None:
        return np.eye(4)
    (low,), (high,) = (
        limit.attribute_numbers("lower", (0.0,), 1),
        limit.attribute_numbers("upper", (0.0,), 1),
    )
    if low <= 0.0 <= high or high < low:
        return np.eye(4)
    axis_element = joint.find("axis")
    axis = np.array((1.0, 0.0, 0.0))
    if axis_element is not None:
        axis = np.array(axis_element.attribute_numbers("xyz", (1.0, 0.0, 0.0), 3))
    length = float(np.linalg.norm(axis))
    if length == 0.0:
        return np.eye(4)
    vector = axis / length * 0.5 * (low + high)
    if kind == "prismatic":
        return pose_from_rotation(np.eye(3), vector)
    rotation = scipy.spatial.transform.Rotation.from_rotvec(vector).as_matrix()
    return pose_from_rotation(rotation, np.zeros(3))


# Detection of URDF among XML files.


def is_urdf(path: Path) -> bool:
    """True for a file with a `<robot>` root."""
    with path.open("rb") as file, suppress(ParseError, StopIteration, ValueError, LookupError):
        _, root = next(iterparse(file, ("start",)))
        return bool(root.tag == "robot")
    return False
