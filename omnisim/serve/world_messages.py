"""Latched messages of a served world: its floor map, and its robots' shapes as URDF."""

from __future__ import annotations

from collections.abc import Mapping
from xml.etree import ElementTree

import numpy as np
import scipy  # its submodules load when first used

from omnisim.core.arrays import Floats
from omnisim.core.errors import PlanError
from omnisim.core.poses import roll_pitch_yaw_from_rotation
from omnisim.datasets.export.ros2 import ros_messages as ros
from omnisim.datasets.free_space import find_free_space
from omnisim.robots.vehicle import BodyBoxes
from omnisim.scene import Scene

RADIUS_M = 0.2  # of cells that count as free: four cells
FREE, OCCUPIED, UNKNOWN = 0, 100, -1  # of nav_msgs/OccupancyGrid


def map_message(scene: Scene, stamp_ns: int, frame: str, boxes: BodyBoxes | None) -> object | None:
    """OccupancyGrid of a scene's floor for a robot's height; None: the scene has no floor.

    It ends one cell beyond the floor. Cells whose surfaces are higher than the robot's clearance
    are occupied; without a floor they are unknown.
    """
    height_m, step_m = (1.0, 0.05) if boxes is None else (float(boxes.high_m[2]), boxes.clearance_m)
    try:
        free = find_free_space(scene, RADIUS_M, height_m, step_m, from_start=False)
    except PlanError:
        return None
    cells = np.where(np.isfinite(free.floor_m), FREE, UNKNOWN)
    cells[free.clearance_m <= 0.75 * free.cell_m] = OCCUPIED
    floor = scipy.ndimage.binary_dilation(cells == FREE)
    (around,) = scipy.ndimage.find_objects(floor.astype(np.int8))
    low_m = free.low_m + free.cell_m * np.array((around[1].start, around[0].start))
    return ros.occupancy_grid(stamp_ns, frame, cells[around].astype(np.int8), low_m, free.cell_m)


def robot_description(
    name: str,
    boxes: BodyBoxes | None,
    base: str,
    frames: Mapping[tuple[str, str], Floats],
) -> str:
    """URDF of a robot: the boxes of its body's parts, and its sensors' frames (4, 4) on the base.

    Source: ROS, the URDF specification.
    """
    root = ElementTree.Element("robot", name=name)
    link = ElementTree.SubElement(root, "link", name=base)
    for low, high in () if boxes is None else boxes.parts_m.tolist():
        visual = ElementTree.SubElement(link, "visual")
        middle = " ".join(f"{0.5 * (a + b):.6g}" for a, b in zip(low, high, strict=True))
        ElementTree.SubElement(visual, "origin", xyz=middle, rpy="0 0 0")
        size = " ".join(f"{b - a:.6g}" for a, b in zip(low, high, strict=True))
        ElementTree.SubElement(ElementTree.SubElement(visual, "geometry"), "box", size=size)
    for (parent, child), pose in frames.items():
        ElementTree.SubElement(root, "link", name=child)
        joint = ElementTree.SubElement(root, "joint", name=f"{child}_joint", type="fixed")
        ElementTree.SubElement(joint, "parent", link=parent)
        ElementTree.SubElement(joint, "child", link=child)
        angles = roll_pitch_yaw_from_rotation(pose[:3, :3]).tolist()
        xyz, rpy = (
            " ".join(f"{value + 0.0:.9g}" for value in row)
            for row in (pose[:3, 3].tolist(), angles)
        )
        ElementTree.SubElement(joint, "origin", xyz=xyz, rpy=rpy)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode")
