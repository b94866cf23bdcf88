"""Estimate of the GPU memory that a scene takes, made before it is drawn."""

from __future__ import annotations

import numpy as np

from omnisim.rendering.opengl.culling.clusters import MAX_COPIED_TRIANGLES
from omnisim.rendering.opengl.geometry.vertex_records import CLUSTER_VERTEX, VERTEX
from omnisim.scene.model import Scene
from omnisim.scene.summary import memory_bytes

_TRIANGLE_BYTES = 12  # in an index buffer
_MIPMAPPED = 4.0 / 3.0


def gpu_bytes(scene: Scene) -> int:
    """Bytes of a scene's vertices, triangles and textures on the GPU.

    Each mesh has its triangles in the clusters once more, and further instances have copies of
    them, up to `MAX_COPIED_TRIANGLES`. Cameras add their images, and at most 128 MiB of draw
    commands each.
    """
    vertices = np.array([len(mesh.positions) for mesh in scene.meshes], dtype=np.int64)
    triangles = np.array([len(mesh.triangles) for mesh in scene.meshes], dtype=np.int64)
    kept = VERTEX.itemsize * vertices.sum() + _TRIANGLE_BYTES * triangles.sum()
    used = np.array([one.mesh for one in scene.instances], dtype=np.intp)
    is_copy = np.ones(len(used), dtype=np.bool_)
    is_copy[np.unique(used, return_index=True)[1]] = False
    clustered = used[~is_copy | (np.cumsum(triangles[used] * is_copy) <= MAX_COPIED_TRIANGLES)]
    kept += CLUSTER_VERTEX.itemsize * vertices[clustered].sum()
    kept += _TRIANGLE_BYTES * triangles[clustered].sum()
    return int(kept + _MIPMAPPED * memory_bytes(scene)[1])
