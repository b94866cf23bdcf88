"""Skinned meshes of glTF, in the pose in which the file has them."""

from __future__ import annotations

from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from omnisim.errors import SceneError

SKINNED_ATTRIBUTES = ("POSITION", "NORMAL", "JOINTS_0", "WEIGHTS_0")


def skinned(
    loaded: trimesh.Scene,
    skin: dict[str, Any],
    attributes: dict[str, NDArray[Any]],
    inverse_binds: NDArray[np.float64] | None,
) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
    """Positions (n, 3) and normals (n, 3) of a primitive in the file's frame.

    Args:
        loaded: the file, its nodes named by their indices.
        skin: the skin's entry in the header.
        attributes: those of `SKINNED_ATTRIBUTES` that the primitive has, normalised integers as
            floats: POSITION and NORMAL (n, 3), JOINTS_0 and WEIGHTS_0 (n, 4).
        inverse_binds: (joints, 4, 4), or None: identities.

    Raises:
        SceneError: a joint that is not there.

    Source: glTF 2.0, section 3.7.3: joint matrix = the joint's global transform times its inverse
    bind matrix; the node of the mesh does not count.
    """
    joints = skin.get("joints", [])
    corners = np.asarray(attributes["JOINTS_0"], dtype=np.int64)
    weights = np.asarray(attributes["WEIGHTS_0"], dtype=np.float64)
    if not joints or corners.max() >= len(joints):
        raise SceneError(f"skin: joint {corners.max()} of {len(joints)}")
    known = set(loaded.graph.nodes)
    if not all(str(joint) in known for joint in joints):
        raise SceneError("skin: a joint is no node of the scene")
    file_from_joint = np.array([loaded.graph.get(str(joint))[0] for joint in joints])
    matrices = file_from_joint if inverse_binds is None else file_from_joint @ inverse_binds
    total = weights.sum(axis=1, keepdims=True)
    shares = np.divide(weights, total, out=np.zeros_like(weights), where=total > 0.0)
    blended = np.einsum("nj,njab->nab", shares, matrices[corners])
    positions = np.asarray(attributes["POSITION"], dtype=np.float64)
    moved = np.einsum("nab,nb->na", blended[:, :3, :3], positions) + blended[:, :3, 3]
    if "NORMAL" not in attributes:
        return moved, None
    return moved, np.einsum("nab,nb->na", blended[:, :3, :3], attributes["NORMAL"])
