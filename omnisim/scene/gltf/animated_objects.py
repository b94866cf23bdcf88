"""Objects that an animation moves, and parts of it that are not played."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from omnisim.poses import nearest_rotation
from omnisim.scene.gltf.animations import Animation
from omnisim.scene.gltf.json_object import JsonObject
from omnisim.scene.imported import ImportedObject
from omnisim.scene.labels import BODY
from omnisim.scene.node_motion import AnimatedNode, NodeMotion

_LIGHTS = "KHR_lights_punctual"
_CHECKS = 32  # of a node's shape, over the animation
Moved = Mapping[int, tuple[int, AnimatedNode]]


def moving_objects(
    nodes: list[JsonObject],
    owners: Sequence[int | None],
    moved: Moved,
    world_from_file: NDArray[np.float64],
) -> tuple[ImportedObject, ...]:
    """Objects of the instances, one for each node that moves and has some.

    Args:
        nodes: of the file.
        owners: index of each instance's node; None: it rests.
        moved: see `animated_nodes`.
        world_from_file: (4, 4).
    """
    instances: dict[int, list[int]] = {}
    for number, owner in enumerate(owners):
        if owner is not None and owner in moved:
            instances.setdefault(moved[owner][0], []).append(number)
    taken, objects = {BODY}, []
    for index, numbers in instances.items():
        name = _free_name(nodes[index].text("name", f"node {index}"), taken)
        taken.add(name)
        node = moved[index][1]
        axes = _axes(node.transform_at(0.0)[:3, :3] @ np.linalg.inv(world_from_file[:3, :3]))
        objects.append(ImportedObject(name, NodeMotion(node, axes), tuple(numbers)))
    return tuple(objects)


def _free_name(name: str, taken: set[str]) -> str:
    number, free = 0, name
    while free in taken:
        number += 1
        free = f"{name}_{number}"
    return free


def _axes(linear: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation (3, 3) of a node's frame: without scale, shear and mirroring."""
    axes = nearest_rotation(linear)
    return axes if np.linalg.det(axes) > 0.0 else -axes


def unplayed_parts(
    root: JsonObject,
    nodes: list[JsonObject],
    animation: Animation,
    moved: Moved,
    objects: Sequence[ImportedObject],
) -> dict[str, Sequence[JsonObject]]:
    """Parts of an animation that rest, by their names in `DrawnObjects`."""
    times_s = np.linspace(0.0, animation.period_s, _CHECKS, endpoint=False)
    reshaped = set(animation.reshaped)
    for one in objects:
        assert isinstance(one.motion, NodeMotion)
        if not all(map(one.motion.is_rigid_at, times_s.tolist())):
            reshaped |= {index for index, node in moved.values() if node is one.motion.node}
    return {
        "animations": animation.others,
        "channels": animation.channels,
        "reshaped": [nodes[index] for index in sorted(reshaped)],
        "skinned": _skinned(root, nodes, animation),
        "shining": [nodes[index] for index in moved if nodes[index].extension(_LIGHTS)],
    }


def _skinned(root: JsonObject, nodes: list[JsonObject], animation: Animation) -> list[JsonObject]:
    """Nodes with a skin that joints of the animation would bend."""
    skins = root.objects("skins")
    targets = {
        target.index("node", nodes)
        for channel in animation.channels
        if (target := channel.object("target")).has("node")
    }
    return [
        node
        for node in nodes
        if node.has("skin")
        and targets & set(skins[node.index("skin", skins)].indices("joints", nodes))
    ]
