"""Node hierarchy: local and global transforms."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import SceneError
from omnisim.core.poses import rotation_from_quaternion
from omnisim.scene.formats.gltf.json_object import JsonObject


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
