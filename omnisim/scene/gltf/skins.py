"""Skinned meshes, in the pose in which the file has them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.scene.gltf.accessors import Accessors
from omnisim.scene.gltf.json_object import JsonObject
from omnisim.scene.gltf.primitives import Primitive


@np.errstate(all="ignore")  # what is not finite is refused with the mesh
def skin_vertices(
    primitive: Primitive, matrices: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
    """Positions (n, 3) and normals (n, 3) of a primitive in the file's frame.

    `matrices` (joints, 4, 4) are by `joint_matrices`.
    """
    positions, weights = primitive.required("POSITION", 3), primitive.required("WEIGHTS_0", 4)
    joints = primitive.required("JOINTS_0", 4)
    if not len(positions) == len(weights) == len(joints):
        raise primitive.entry.error("attributes", "as many JOINTS_0 and WEIGHTS_0 as POSITION")
    if not ((joints >= 0) & (joints < len(matrices))).all():  # also NaN
        raise primitive.entry.error("attributes", f"JOINTS_0 below {len(matrices)}")
    total = weights.sum(axis=1, keepdims=True)
    shares = np.divide(weights, total, out=np.zeros_like(weights), where=total > 0.0)
    blended = np.einsum("nj,njab->nab", shares, matrices[joints.astype(np.int64)])
    skinned = np.einsum("nab,nb->na", blended[:, :3, :3], positions) + blended[:, :3, 3]
    normals = primitive.attribute("NORMAL")
    if normals is None or normals.shape != positions.shape:
        return skinned, None
    return skinned, np.einsum("nab,nb->na", blended[:, :3, :3], normals)


@np.errstate(all="ignore")
def joint_matrices(
    skin: JsonObject, accessors: Accessors, nodes: dict[int, NDArray[np.float64]]
) -> NDArray[np.float64]:
    """Transforms (joints, 4, 4) from a skinned mesh to the file's frame.

    `nodes` has file_from_node (4, 4) of the nodes of the scene.

    Source: glTF 2.0, section 3.7.3.3: the joint's global transform times its inverse bind matrix;
    the node of the mesh does not count.
    """
    joints = skin.indices("joints", range(1 + max(nodes)))
    if not nodes.keys() >= set(joints):
        raise skin.error("joints", "nodes of the scene")
    matrices = np.array([nodes[joint] for joint in joints]).reshape(-1, 4, 4)
    if not skin.has("inverseBindMatrices"):
        return matrices
    # stored column after column
    inverse_binds = accessors.floats(skin, "inverseBindMatrices").swapaxes(1, -1)
    if inverse_binds.shape != matrices.shape:
        raise skin.error("inverseBindMatrices", f"an accessor of {len(matrices)} MAT4")
    return matrices @ inverse_binds
