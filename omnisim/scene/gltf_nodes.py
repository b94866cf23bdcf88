"""The node tree of a glTF file: where everything is."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def node_poses(header: dict[str, Any]) -> dict[int, NDArray[np.float64]]:
    """Matrices (4, 4) file_from_node of the nodes of the file's scene, in the order of drawing.

    A file without scenes shows all that is in it.
    """
    nodes, poses = header.get("nodes", []), {}
    # the last first: so has every run that is recorded numbered its instances
    waiting = [(np.eye(4), root) for root in _roots(header)]
    while waiting:
        file_from_parent, index = waiting.pop()
        if index in poses:
            continue
        poses[index] = file_from_parent @ _parent_from_node(nodes[index])
        waiting += [(poses[index], child) for child in nodes[index].get("children", [])]
    return poses


def _roots(header: dict[str, Any]) -> list[int]:
    if header.get("scenes"):
        return header["scenes"][header.get("scene", 0)].get("nodes", [])
    nodes = header.get("nodes", [])
    children = {child for node in nodes for child in node.get("children", [])}
    return [index for index in range(len(nodes)) if index not in children]


def _parent_from_node(node: dict[str, Any]) -> NDArray[np.float64]:
    """Source: glTF 2.0, section 3.5.3: a matrix column by column, or translation · rotation ·
    scale; quaternions have w last."""
    pose = np.eye(4)
    if node.get("matrix") is not None:
        pose = np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    if node.get("translation") is not None:
        moved = np.eye(4)
        moved[:3, 3] = node["translation"]
        pose = pose @ moved
    if node.get("rotation") is not None:
        pose = pose @ _rotation(np.array(node["rotation"], dtype=np.float64))
    if node.get("scale") is not None:
        pose = pose @ np.diag((*node["scale"], 1.0))
    return pose


def _rotation(quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
    """Matrix (4, 4) of a quaternion (4,), x y z w, of any length; one without length turns
    nothing."""
    matrix = np.eye(4)
    squared = quaternion @ quaternion
    if squared < np.finfo(np.float64).eps:
        return matrix
    x, y, z, w = quaternion * np.sqrt(2.0 / squared)
    matrix[:3, :3] = (
        (1.0 - y * y - z * z, x * y - z * w, x * z + y * w),
        (x * y + z * w, 1.0 - x * x - z * z, y * z - x * w),
        (x * z - y * w, y * z + x * w, 1.0 - x * x - y * y),
    )
    return matrix
