"""Skins: joints and weights of vertices, and transforms of joints."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.scene.formats.gltf.accessors import Accessors
from omnisim.scene.formats.gltf.json_object import JsonObject
from omnisim.scene.formats.gltf.primitives import Primitive

Matrix = NDArray[np.float64]
_SUM_TOLERANCE = 0.01  # for sums of weights, above the rounding of four 8-bit weights
_SINGULAR = 1e-12  # minimum determinant of a bind matrix, relative to its cubed scale


class JointWeights(NamedTuple):
    """Joints of a primitive's vertices, up to eight per vertex.

    Attributes:
        joints: (n, k) joint indices.
        shares: (n, k) weights, which sum to 1; a vertex without weights follows its first joint.
        mended: number of vertices whose weights in the file do not sum to 1.
    """

    joints: NDArray[np.int64]
    shares: Matrix
    mended: int


@np.errstate(all="ignore")  # a mesh with non-finite values is rejected later
def joint_weights(primitive: Primitive, joint_count: int) -> JointWeights:
    """Joints and weights of a primitive, for a skin with `joint_count` joints.

    Raises:
        SceneError: attributes differ in count, a joint does not exist, or a weight is not finite.
    """
    sets = ["0", "1"] if primitive.has("JOINTS_1") and primitive.has("WEIGHTS_1") else ["0"]
    count = len(primitive.required("POSITION", 3))
    joints, weights = (
        np.concatenate([primitive.required(f"{name}_{one}", 4) for one in sets], axis=1)
        if _lengths(primitive, name, sets) == {count}
        else None
        for name in ("JOINTS", "WEIGHTS")
    )
    if joints is None or weights is None:
        raise primitive.entry.error("attributes", "as many JOINTS and WEIGHTS as POSITION")
    if not ((joints >= 0) & (joints < joint_count)).all():  # rejects NaN as well
        raise primitive.entry.error("attributes", f"JOINTS below {joint_count}")
    if not np.isfinite(weights).all():
        raise primitive.entry.error("attributes", "finite WEIGHTS")
    total = weights.sum(axis=1, keepdims=True)
    shares = np.divide(weights, total, out=np.zeros_like(weights), where=total > 0.0)
    shares[~(total[:, 0] > 0.0), 0] = 1.0
    mended = int((np.abs(total - 1.0) > _SUM_TOLERANCE).sum())
    return JointWeights(joints.astype(np.int64), shares, mended)


def _lengths(primitive: Primitive, name: str, sets: list[str]) -> set[int]:
    return {len(primitive.required(f"{name}_{one}", 4)) for one in sets}


@np.errstate(all="ignore")
def skin_vertices(
    positions: Matrix, normals: Matrix | None, weights: JointWeights, matrices: Matrix
) -> tuple[Matrix, Matrix | None]:
    """Positions (n, 3) and normals (n, 3) of a static skin, from matrices (joints, 4, 4)."""
    blended = np.einsum("nj,njab->nab", weights.shares, matrices[weights.joints])
    skinned = np.einsum("nab,nb->na", blended[:, :3, :3], positions) + blended[:, :3, 3]
    if normals is None or normals.shape != positions.shape:
        return skinned, None
    return skinned, np.einsum("nab,nb->na", blended[:, :3, :3], normals)


def joints_of(skin: JsonObject, nodes: Mapping[int, Matrix]) -> list[int]:
    """Indices of a skin's joints, all of which must be in `nodes` of the scene.

    Raises:
        SceneError: a joint is not a node of the scene.
    """
    joints = skin.indices("joints", range(1 + max(nodes)))
    if not nodes.keys() >= set(joints):
        raise skin.error("joints", "nodes of the scene")
    return joints


def inverse_binds(skin: JsonObject, accessors: Accessors, count: int) -> Matrix:
    """Inverse bind matrices (count, 4, 4) of a skin's joints.

    Source: glTF 2.0, section 3.7.3.3: a joint's global transform times its inverse bind matrix; the
    node of the mesh is ignored.

    Raises:
        SceneError: the accessor does not have one matrix per joint.
    """
    if not skin.has("inverseBindMatrices"):
        return np.tile(np.eye(4), (count, 1, 1))
    # stored in column-major order
    matrices = accessors.floats(skin, "inverseBindMatrices").swapaxes(1, -1)
    if matrices.shape != (count, 4, 4):
        raise skin.error("inverseBindMatrices", f"an accessor of {count} MAT4")
    return matrices


@np.errstate(all="ignore")
def singular_count(matrices: Matrix) -> int:
    """Number of singular matrices among matrices (n, 4, 4)."""
    linear = matrices[:, :3, :3]
    scales = np.abs(linear).max(axis=(1, 2))
    return int((~(np.abs(np.linalg.det(linear)) > _SINGULAR * scales**3)).sum())
