"""Instanced copies of a node's mesh.

Source: EXT_mesh_gpu_instancing.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.core.poses import rotation_from_quaternion
from omnisim.scene.formats.gltf.accessors import Accessors
from omnisim.scene.formats.gltf.json_object import JsonObject

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
