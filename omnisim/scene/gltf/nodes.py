"""Node hierarchy: from local to global transforms."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.errors import SceneError
from omnisim.scene.gltf import schema


def parent_from_node(node: schema.Node) -> NDArray[np.float64]:
    """Local transform (4, 4): the matrix, or translation · rotation · scale."""
    matrix = np.eye(4)
    if node.matrix is not None:
        matrix = _orthonormalize(np.reshape(node.matrix, (4, 4)).T)
    if node.translation is not None:
        translation = np.eye(4)
        translation[:3, 3] = node.translation
        matrix = matrix @ translation
    if node.rotation is not None:
        matrix = matrix @ _rotation(node.rotation)
    if node.scale is not None:
        matrix = matrix @ np.diag((*node.scale, 1.0))
    return matrix


def file_from_nodes(document: schema.Document) -> dict[int, NDArray[np.float64]]:
    """Global transforms (4, 4) of the nodes of the shown scene, in the order of drawing.

    A file without scenes shows all of its roots.

    Raises:
        SceneError: the nodes are no forest.
    """
    if document.scenes:
        roots = schema.lookup(document.scenes, document.scene, "scene").nodes
        place = f"scenes[{document.scene}].nodes"
    else:
        children = {child for node in document.nodes for child in node.children}
        roots = tuple(index for index in range(len(document.nodes)) if index not in children)
        place = "nodes"
    found: dict[int, NDArray[np.float64]] = {}
    stack = [(place, index, np.eye(4)) for index in roots]
    while stack:
        place, index, file_from_parent = stack.pop()
        if index in found:
            raise SceneError(f"nodes[{index}]: expected one parent, got two, or itself as ancestor")
        node = schema.lookup(document.nodes, index, place)
        found[index] = file_from_parent @ parent_from_node(node)
        place = f"nodes[{index}].children"
        stack += [(place, child, found[index]) for child in node.children]
    return found


def _rotation(quaternion: schema.Vec4) -> NDArray[np.float64]:
    """Rotation (4, 4) of a quaternion (x, y, z, w) of any length; identity where that is 0."""
    matrix = np.eye(4)
    norm = np.dot(quaternion, quaternion)
    if norm < 4.0 * np.finfo(np.float64).eps:
        return matrix
    x, y, z, w = np.array(quaternion) * np.sqrt(2.0 / norm)
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
