"""NumPy record types of the scene's vertex buffers, and the memory that they take.

Using them opens no OpenGL.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from omnisim.core.arrays import Floats32
from omnisim.rendering.opengl.culling.clusters import (
    CORNERS_BYTES,
    MAX_COPIED_TRIANGLES,
    MAX_ROOM,
)
from omnisim.scene.model import Mesh, Scene
from omnisim.scene.parts import LightRectangle
from omnisim.scene.summary import memory_bytes
from omnisim.scene.surface_kind import SurfaceKind, kind_of

VERTEX = np.dtype(  # read word by word in shaders/scene/vertex_words.glsl
    [
        ("in_position", "<f4", 3),
        ("in_normal", "<f4", 3),  # zero: flat, use the triangle's
        ("in_texture_coordinate", "<f4", 2),
        ("in_color", "<f2", 4),
    ]
)
CLUSTER_VERTEX = np.dtype(  # carries its material, for any draw call
    [
        ("in_position", "<f4", 3),
        ("in_texture_coordinate", "<f4", 2),
        ("in_material", "<u4"),  # entry of the palette: color, texture layer, cutoff, light
    ]
)
NORMAL_BYTES = 12  # of such a vertex, in a buffer of its own
INSTANCE = np.dtype(  # one object in one view, as in shaders/culling/views.glsl
    [
        ("in_clip_from_object", "<f4", (4, 4)),
        ("in_placement", "<f4", 4),
        ("in_viewpoint_from_object", "<f4", (3, 4)),
        ("viewpoint", "<f4", 4),  # for culling only
    ]
)


def light_coordinates(
    parts: Sequence[tuple[int, Mesh, Sequence[LightRectangle]]], count: int
) -> Floats32:
    """Lightmap coordinates (count, 4) of parts, by first vertex; negative: none."""
    places = np.full((count, 4), -1.0, dtype=np.float32)
    for base, mesh, rectangles in parts:
        of_mesh = places[base : base + len(mesh.positions)]
        for side, rectangle in enumerate(rectangles):
            if mesh.light_coordinates is not None:
                within = mesh.light_coordinates * np.array(rectangle[2:])
                of_mesh[:, 2 * side : 2 * side + 2] = np.array(rectangle[:2]) + within
    return places


# Estimate of the GPU memory that a scene takes, made before it is drawn.
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
    kinds = [kind_of(scene.materials[mesh.material]) for mesh in scene.meshes]
    is_single = np.array([bool(kind & SurfaceKind.SEE_THROUGH) for kind in kinds], dtype=np.bool_)
    is_single |= np.array([mesh.deformation is not None for mesh in scene.meshes], dtype=np.bool_)
    used = np.array([instance.mesh for instance in scene.instances], dtype=np.intp)
    is_copy = np.ones(len(used), dtype=np.bool_)
    is_copy[np.unique(used, return_index=True)[1]] = False
    copied = np.cumsum(triangles[used] * is_copy)
    is_clustered = ~is_single[used] & (~is_copy | (copied <= MAX_COPIED_TRIANGLES))
    clustered = used[is_clustered]
    has_normals = any(scene.meshes[index].normals is not None for index in set(clustered.tolist()))
    vertex_bytes = CLUSTER_VERTEX.itemsize + (NORMAL_BYTES if has_normals else 0)
    kept = vertex_bytes * vertices[clustered].sum()
    count = triangles[clustered].sum()
    kept += (_TRIANGLE_BYTES + CORNERS_BYTES) * count + _TRIANGLE_BYTES * min(count, MAX_ROOM)
    if not is_clustered.all():
        kept += VERTEX.itemsize * vertices.sum() + _TRIANGLE_BYTES * triangles.sum()
    return int(kept + _MIPMAPPED * memory_bytes(scene)[1])
