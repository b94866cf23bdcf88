"""Skinned meshes, in the pose in which the file has them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.errors import SceneError
from omnisim.scene.gltf import schema
from omnisim.scene.gltf.accessors import Accessors
from omnisim.scene.gltf.primitives import Primitive


def joint_matrices(
    index: int,
    document: schema.Document,
    accessors: Accessors,
    file_from_nodes: dict[int, NDArray[np.float64]],
) -> NDArray[np.float64]:
    """Transforms (joints, 4, 4) from a skinned mesh to the file's frame.

    Raises:
        SceneError: a joint that is not in the scene, or another count of inverse bind matrices.

    Source: glTF 2.0, section 3.7.3.3: the joint's global transform times its inverse bind matrix;
    the node of the mesh does not count.
    """
    place = f"skins[{index}]"
    skin = schema.lookup(document.skins, index, "nodes.skin")
    for joint in skin.joints:
        if joint not in file_from_nodes:
            raise SceneError(f"{place}.joints: expected nodes of the scene, got {joint}")
    matrices = np.array([file_from_nodes[joint] for joint in skin.joints]).reshape(-1, 4, 4)
    if skin.inverse_bind_matrices is None:
        return matrices
    # stored column after column
    inverse_binds = accessors.floats(skin.inverse_bind_matrices, place).swapaxes(1, -1)
    if inverse_binds.shape != matrices.shape:
        raise SceneError(
            f"{place}.inverseBindMatrices: expected {len(matrices)} MAT4, "
            f"got shape {inverse_binds.shape}"
        )
    return matrices @ inverse_binds


def skin_vertices(
    primitive: Primitive, file_from_mesh: NDArray[np.float64], place: str
) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
    """Positions (n, 3) and normals (n, 3) of a primitive in the file's frame.

    Args:
        primitive: with JOINTS_0 and WEIGHTS_0.
        file_from_mesh: (joints, 4, 4), by `joint_matrices`.
        place: of the skin in the JSON.

    Raises:
        SceneError: damaged attributes, or a joint that is not there.
    """
    positions, weights = primitive.required("POSITION", 3), primitive.required("WEIGHTS_0", 4)
    joints = primitive.required("JOINTS_0", 4).astype(np.int64)
    if not len(positions) == len(weights) == len(joints):
        raise SceneError(
            f"{place}: expected {len(positions)} JOINTS_0 and WEIGHTS_0, "
            f"got {len(joints)} and {len(weights)}"
        )
    if len(joints) and not 0 <= joints.min() <= joints.max() < len(file_from_mesh):
        raise SceneError(
            f"{place}: expected JOINTS_0 below {len(file_from_mesh)}, got {joints.max()}"
        )
    total = weights.sum(axis=1, keepdims=True)
    shares = np.divide(weights, total, out=np.zeros_like(weights), where=total > 0.0)
    blended = np.einsum("nj,njab->nab", shares, file_from_mesh[joints])
    skinned = np.einsum("nab,nb->na", blended[:, :3, :3], positions) + blended[:, :3, 3]
    normals = primitive.floats("NORMAL")
    if normals is None or normals.shape != positions.shape:
        return skinned, None
    return skinned, np.einsum("nab,nb->na", blended[:, :3, :3], normals)
