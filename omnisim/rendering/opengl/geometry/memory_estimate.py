"""Estimate of the GPU memory that a scene takes, made before it is drawn."""

from __future__ import annotations

import numpy as np

from omnisim.rendering.opengl.culling.clusters import MAX_COPIED_TRIANGLES
from omnisim.rendering.opengl.geometry.vertex_records import CLUSTER_VERTEX, NORMAL_BYTES, VERTEX
from omnisim.scene.model import Scene
from omnisim.scene.summary import memory_bytes

_TRIANGLE_BYTES = 12  # in an index buffer
_MIPMAPPED = 4.0 / 3.0


def gpu_bytes(scene: Scene) -> int:
    """Bytes of a scene's vertices, triangles and textures on the GPU, for images.

    Clusters have all opaque and masked meshes once, and further instances' copies of them, up to
    `MAX_COPIED_TRIANGLES`. If instances remain that are drawn one by one, buffers for all meshes
    are added, as they are for ground truth. The palette of the clusters' vertices is small, unless
    vertices have many colors. Cameras add their images, and at most 128 MiB of draw
    commands each.
    """
    vertices = np.array([len(mesh.positions) for mesh in scene.meshes], dtype=np.int64)
    triangles = np.array([len(mesh.triangles) for mesh in scene.meshes], dtype=np.int64)
    is_single = np.array(
        [
            scene.materials[mesh.material].is_see_through or mesh.deformation is not None
            for mesh in scene.meshes
        ],
        dtype=np.bool_,
    )
    used = np.array([one.mesh for one in scene.instances], dtype=np.intp)
    is_copy = np.ones(len(used), dtype=np.bool_)
    is_copy[np.unique(used, return_index=True)[1]] = False
    copied = np.cumsum(triangles[used] * is_copy)
    is_clustered = ~is_single[used] & (~is_copy | (copied <= MAX_COPIED_TRIANGLES))
    clustered = used[is_clustered]
    has_normals = any(scene.meshes[index].normals is not None for index in set(clustered.tolist()))
    vertex_bytes = CLUSTER_VERTEX.itemsize + (NORMAL_BYTES if has_normals else 0)
    kept = vertex_bytes * vertices[clustered].sum()
    kept += _TRIANGLE_BYTES * triangles[clustered].sum()
    if not is_clustered.all():
        kept += VERTEX.itemsize * vertices.sum() + _TRIANGLE_BYTES * triangles.sum()
    return int(kept + _MIPMAPPED * memory_bytes(scene)[1])
