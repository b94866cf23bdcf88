"""NumPy record types of the scene's vertex buffers; using them opens no OpenGL."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from omnisim.scene.model import Mesh
from omnisim.scene.parts import LightRectangle

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


def fill_vertices(vertices: NDArray[np.void], mesh: Mesh) -> None:
    """Write a mesh's vertices to records of `VERTEX`."""
    vertices["in_position"] = mesh.positions
    vertices["in_color"] = 1.0
    if mesh.normals is not None:
        vertices["in_normal"] = mesh.normals
    if mesh.texture_coordinates is not None:
        vertices["in_texture_coordinate"] = mesh.texture_coordinates
    if mesh.colors is not None:
        vertices["in_color"] = mesh.colors


def light_coordinates(
    parts: Sequence[tuple[int, Mesh, Sequence[LightRectangle]]], count: int
) -> NDArray[np.float32]:
    """Lightmap coordinates (count, 4) of vertices, front and back; negative: none.

    Args:
        parts: first vertex, mesh, and its lightmap rectangles of front and back, if any.
        count: number of all vertices.
    """
    places = np.full((count, 4), -1.0, dtype=np.float32)
    for base, mesh, rectangles in parts:
        of_mesh = places[base : base + len(mesh.positions)]
        for side, rectangle in enumerate(rectangles):
            if mesh.light_coordinates is not None:
                within = mesh.light_coordinates * np.array(rectangle[2:])
                of_mesh[:, 2 * side : 2 * side + 2] = np.array(rectangle[:2]) + within
    return places
