"""Camera nodes as viewpoints: poses only, since their lenses are not omnidirectional."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from omnisim.core.poses import roll_pitch_yaw_from_rotation
from omnisim.scene.files.imported_scene import MAX_COORDINATE
from omnisim.scene.formats.gltf.json_object import JsonObject
from omnisim.scene.parts import CameraPose


def read_cameras(
    root: JsonObject, nodes: list[JsonObject], world_from_node: Mapping[int, NDArray[np.float64]]
) -> tuple[CameraPose, ...]:
    """Poses of the camera nodes, named after the nodes, or else after the cameras.

    Args:
        root: top-level object of the file.
        nodes: all nodes of the file.
        world_from_node: (4, 4) poses by node index, in drawing order.

    Source: glTF 2.0, section 3.10: a camera looks along −z, with y up; its scale is ignored.
    """
    cameras, poses = root.objects("cameras"), dict[str, CameraPose]()
    for index in sorted(world_from_node):
        if not nodes[index].has("camera"):
            continue
        camera = cameras[nodes[index].index("camera", cameras)]
        name = nodes[index].text("name", camera.text("name", f"camera {len(poses)}"))
        free, number = name, 1
        while free in poses:
            free, number = f"{name}_{number}", number + 1
        pose = _camera_pose(free, world_from_node[index])
        if pose is not None:
            poses[free] = pose
    return tuple(poses.values())


def _camera_pose(name: str, world_from_node: NDArray[np.float64]) -> CameraPose | None:
    """Pose of a camera node; None: degenerate axes or coordinates that are too large."""
    if not np.abs(world_from_node).max() < MAX_COORDINATE:  # false for NaN as well
        return None
    ahead, up = -world_from_node[:3, 2], world_from_node[:3, 1]
    left = np.cross(up, ahead)
    lengths = np.linalg.norm(ahead), np.linalg.norm(left)
    if not min(lengths) > 0.0:
        return None
    ahead, left = ahead / lengths[0], left / lengths[1]
    rotation = np.stack((ahead, left, np.cross(ahead, left)), axis=1)
    roll, pitch, yaw = (
        round(angle, 6) + 0.0  # avoids -0.0
        for angle in np.degrees(roll_pitch_yaw_from_rotation(rotation)).tolist()
    )
    x, y, z = world_from_node[:3, 3].tolist()
    return CameraPose(name, (x, y, z), yaw, pitch, roll)
