"""Dynamic objects of an animation, its non-rigid nodes, and its unplayed parts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from omnisim.core.poses import nearest_rotation
from omnisim.scene.files.imported_scene import ImportedObject
from omnisim.scene.formats.gltf.animations import Animation, MovingNode
from omnisim.scene.formats.gltf.json_object import JsonObject
from omnisim.scene.labels import BODY
from omnisim.scene.motion.node_motion import NodeMotion

_LIGHTS = "KHR_lights_punctual"
_CHECKS = 32  # samples of a node's motion over the animation
Moved = Mapping[int, MovingNode]
Matrix = NDArray[np.float64]


def moving_objects(
    nodes: list[JsonObject],
    owners: Sequence[int | None],
    moved: Moved,
    world_from_file: Matrix,
) -> tuple[ImportedObject, ...]:
    """Dynamic objects, one for each moving node with instances.

    Args:
        nodes: all nodes of the file.
        owners: index of each instance's moving node; None: a static instance.
        moved: moving nodes, see `animated_nodes`.
        world_from_file: (4, 4) transform.
    """
    instances: dict[int, list[int]] = {}
    for number, owner in enumerate(owners):
        if owner is not None and owner in moved:
            instances.setdefault(moved[owner].owner, []).append(number)
    used_names, objects = {BODY}, []
    for index, numbers in instances.items():
        name = _free_name(nodes[index].text("name", f"node {index}"), used_names)
        used_names.add(name)
        node = moved[index].node
        axes = _axes(node.transform_at(0.0)[:3, :3] @ np.linalg.inv(world_from_file[:3, :3]))
        objects.append(ImportedObject(name, NodeMotion(node, axes), tuple(numbers)))
    return tuple(objects)


def _free_name(name: str, used_names: set[str]) -> str:
    number, free = 0, name
    while free in used_names:
        number += 1
        free = f"{name}_{number}"
    return free


def _axes(linear: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation (3, 3) of a node's frame, without scale, shear and mirroring."""
    axes = nearest_rotation(linear)
    return axes if np.linalg.det(axes) > 0.0 else -axes


def reshaped_nodes(nodes: list[JsonObject], moved: Moved, animation: Animation) -> set[int]:
    """Indices of mesh nodes with non-rigid motion: their scale or shear changes."""
    times_s = np.linspace(0.0, animation.period_s, _CHECKS, endpoint=False).tolist()
    is_rigid: dict[int, bool] = {}
    reshaped = set()
    for index, (owner, node, _) in moved.items():
        if not nodes[index].has("mesh"):
            continue
        if owner not in is_rigid:
            motion = NodeMotion(node, np.eye(3))
            is_rigid[owner] = all(map(motion.is_rigid_at, times_s))
        if not is_rigid[owner]:
            reshaped.add(index)
    return reshaped


def unplayed_parts(
    nodes: list[JsonObject], animation: Animation, moved: Moved
) -> dict[str, Sequence[JsonObject]]:
    """Parts of an animation that are not played, by field name of `DrawnObjects`."""
    return {
        "animations": animation.others,
        "channels": animation.channels,
        "shining": [nodes[index] for index in moved if nodes[index].extension(_LIGHTS)],
    }
