"""Node hierarchy: local and global transforms."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.errors import SceneError
from omnisim.scene.gltf.json_object import JsonObject


def file_from_nodes(root: JsonObject, nodes: list[JsonObject]) -> dict[int, NDArray[np.float64]]:
    """Global transforms (4, 4) of the nodes of the file's scene, in the order of drawing.

    Without any scene, all root nodes are shown.

    Raises:
        SceneError: the nodes are no forest, or damaged.
    """
    scenes = root.objects("scenes")
    if scenes:
        scene = scenes[root.index("scene", scenes) if root.has("scene") else 0]
        roots = scene.indices("nodes", nodes)
    else:
        children = {child for node in nodes for child in node.indices("children", nodes)}
        roots = [index for index in range(len(nodes)) if index not in children]
    found: dict[int, NDArray[np.float64]] = {}
    stack = [(index, np.eye(4)) for index in roots]
    while stack:
        index, file_from_parent = stack.pop()
        if index in found:
            raise SceneError(f"nodes[{index}]: expected one parent, got two, or itself as ancestor")
        found[index] = file_from_parent @ _parent_from_node(nodes[index])
        stack += [(child, found[index]) for child in nodes[index].indices("children", nodes)]
    return found


def _parent_from_node(node: JsonObject) -> NDArray[np.float64]:
    """Local transform (4, 4): the matrix, or translation · rotation · scale."""
    result = np.eye(4)
    if (matrix := node.numbers("matrix", 16)) is not None:
        result = _orthonormalize(np.reshape(matrix, (4, 4)).T)
    if (translation := node.numbers("translation", 3)) is not None:
        shift = np.eye(4)
        shift[:3, 3] = translation
        result = result @ shift
    if (quaternion := node.numbers("rotation", 4)) is not None:
        result = result @ _rotation(np.array(quaternion))
    if (scale := node.numbers("scale", 3)) is not None:
        result = result @ np.diag((*scale, 1.0))
    return result


def _rotation(quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation (4, 4) of a quaternion (x, y, z, w) of any length; identity where that is 0."""
    matrix = np.eye(4)
    norm = quaternion @ quaternion
    if norm > 1e-15:
        x, y, z, w = quaternion * np.sqrt(2.0 / norm)
        matrix[:3, :3] = (
            (1.0 - y * y - z * z, x * y - z * w, x * z + y * w),
            (x * y + z * w, 1.0 - x * x - z * z, y * z - x * w),
            (x * z - y * w, y * z + x * w, 1.0 - x * x - y * y),
        )
    return matrix


def _orthonormalize(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """A matrix (4, 4) that is rigid, mirrored or not, but for the digits that its file gives."""
    linear = matrix[:3, :3]
    error = np.abs(linear @ linear.T - np.eye(3)).max()
    if not 1e-13 < error < 1e-5:
        return matrix
    left, _, right = np.linalg.svd(linear)
    rigid = matrix.copy()
    rigid[:3, :3] = left @ right
    return rigid
