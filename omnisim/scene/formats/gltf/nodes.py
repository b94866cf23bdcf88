"""Nodes: their hierarchy, copies and lights."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import SceneError
from omnisim.core.poses import rotation_from_quaternion
from omnisim.scene.formats.gltf.accessors import Accessors
from omnisim.scene.formats.gltf.document import JsonObject
from omnisim.scene.model import Light, LightKind


def scene_parents(root: JsonObject, nodes: list[JsonObject]) -> dict[int, int | None]:
    """Parent of each node of the file's scene, in drawing order.

    Without any scene, all root nodes are drawn.

    Raises:
        SceneError: a node has two parents, or is its own ancestor.
    """
    scenes = root.objects("scenes")
    if scenes:
        scene = scenes[root.index("scene", scenes) if root.has("scene") else 0]
        roots = scene.indices("nodes", nodes)
    else:
        children = {child for node in nodes for child in node.indices("children", nodes)}
        roots = [index for index in range(len(nodes)) if index not in children]
    parents: dict[int, int | None] = {}
    stack: list[tuple[int, int | None]] = [(index, None) for index in roots]
    while stack:  # depth first, last child first: instance labels follow this order
        index, parent = stack.pop()
        if index in parents:
            raise SceneError(f"nodes[{index}]: expected one parent, got two, or itself as ancestor")
        parents[index] = parent
        stack += [(child, index) for child in nodes[index].indices("children", nodes)]
    return parents


def file_from_nodes(
    parents: Mapping[int, int | None], local: Mapping[int, NDArray[np.float64]]
) -> dict[int, NDArray[np.float64]]:
    """Global transforms (4, 4) of nodes, in drawing order, from their local ones."""
    global_transforms: dict[int, NDArray[np.float64]] = {}
    for index, parent in parents.items():
        global_transforms[index] = (
            np.eye(4) if parent is None else global_transforms[parent]
        ) @ local[index]
    return global_transforms


def parent_from_node(node: JsonObject) -> NDArray[np.float64]:
    """Local transform (4, 4): the matrix, or translation · rotation · scale."""
    result = np.eye(4)
    if (matrix := node.numbers("matrix", 16)) is not None:
        result = _orthonormalize(np.reshape(matrix, (4, 4)).T)
    if (translation := node.numbers("translation", 3)) is not None:
        shift = np.eye(4)
        shift[:3, 3] = translation
        result = result @ shift
    quaternion = node.numbers("rotation", 4)
    if quaternion is not None and np.linalg.norm(quaternion) > 1e-7:
        rotation = np.eye(4)
        rotation[:3, :3] = rotation_from_quaternion(quaternion)
        result = result @ rotation
    if (scale := node.numbers("scale", 3)) is not None:
        result = result @ np.diag((*scale, 1.0))
    return result


def _orthonormalize(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Matrix (4, 4), orthonormalized if it is rigid or mirrored up to the file's rounding."""
    linear = matrix[:3, :3]
    error = np.abs(linear @ linear.T - np.eye(3)).max()
    if not 1e-13 < error < 1e-5:
        return matrix
    left, _, right = np.linalg.svd(linear)
    rigid = matrix.copy()
    rigid[:3, :3] = left @ right
    return rigid


# Instanced copies of a node's mesh.
#
# Source: EXT_mesh_gpu_instancing.


MAX_COPIES = 200_000
_COMPONENTS = {"TRANSLATION": 3, "ROTATION": 4, "SCALE": 3}


def read_copies(node: JsonObject, accessors: Accessors) -> NDArray[np.float64] | None:
    """Transforms (n, 4, 4) node_from_copies of a node's copies; None: no instancing.

    Raises:
        SceneError: attributes that are not vectors or differ in count, or too many copies.
    """
    extension = node.extension("EXT_mesh_gpu_instancing")
    if extension is None:
        return None
    entry = extension.object("attributes")
    values_of: dict[str, NDArray[np.float64]] = {}
    count: int | None = None
    for name, components in _COMPONENTS.items():
        if not entry.has(name):
            continue
        values = accessors.floats(entry, name)
        count = len(values) if count is None else count
        if values.shape != (count, components) or not np.isfinite(values).all():
            raise entry.error(name, f"an accessor of {count} finite VEC{components}")
        if count > MAX_COPIES:
            raise entry.error(name, f"an accessor of at most {MAX_COPIES} copies")
        values_of[name] = values
    if count is None:
        return None
    matrices = np.tile(np.eye(4), (count, 1, 1))
    if "ROTATION" in values_of and count:
        turns = values_of["ROTATION"]
        turns[np.linalg.norm(turns, axis=1) < 1e-7] = (0.0, 0.0, 0.0, 1.0)
        matrices[:, :3, :3] = rotation_from_quaternion(turns)
    if "SCALE" in values_of:
        matrices[:, :3, :3] *= values_of["SCALE"][:, None, :]
    if "TRANSLATION" in values_of:
        matrices[:, :3, 3] = values_of["TRANSLATION"]
    return matrices


# Punctual lights.


_EXTENSION = "KHR_lights_punctual"
_KINDS = {kind.value: kind for kind in LightKind}


def read_lights(
    root: JsonObject, nodes: list[JsonObject], world_from_nodes: dict[int, NDArray[np.float64]]
) -> tuple[Light, ...]:
    """Lights of the scene's nodes, in the world frame.

    Source: KHR_lights_punctual; a light shines along −z of its node.
    """
    extension = root.extension(_EXTENSION)
    entries = extension.objects("lights") if extension else []
    lights = []
    for index in sorted(world_from_nodes):
        reference = nodes[index].extension(_EXTENSION)
        if reference is None:
            continue
        entry, world_from_light = (
            entries[reference.index("light", entries)],
            world_from_nodes[index],
        )
        kind, axis = _KINDS.get(entry.text("type", "")), -world_from_light[:3, 2]
        length = np.linalg.norm(axis)
        if kind is None or length == 0.0:
            continue
        red, green, blue = entry.numbers("color", 3) or (1.0, 1.0, 1.0)
        range_m, spot = entry.number("range", 0.0), entry.object("spot")
        inner = spot.number("innerConeAngle", 0.0)
        outer = spot.number("outerConeAngle", math.pi / 4.0)
        lights.append(
            Light(
                kind,
                (red, green, blue),
                entry.number("intensity", 1.0),
                position_m=world_from_light[:3, 3],
                direction=axis / length,
                range_m=range_m if range_m > 0.0 else math.inf,
                cone_cosines=(math.cos(inner), math.cos(outer)),
            )
        )
    return tuple(lights)
