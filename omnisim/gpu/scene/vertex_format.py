"""Vertex format of the scene's buffers, and the vertex arrays that feed programs with it."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.scene.model import Mesh

VERTEX = np.dtype(  # read word by word in shaders/scene/vertex_words.glsl
    [
        ("in_position", "<f4", 3),
        ("in_normal", "<f4", 3),  # zero: flat, the triangle's own; or in_light, see below
        ("in_texture_coordinate", "<f4", 2),
        ("in_color", "<f2", 4),
    ]
)
# Attribute of baked triangles, stored in the place of another one.
_LIGHT, _IN_PLACE_OF = "in_light", "in_normal"
_FORMATS = {3: "3f4", 2: "2f4", 4: "4f2"}


def fill_vertices(vertices: NDArray[np.void], mesh: Mesh) -> None:
    """Write the vertices of a mesh into as many of `VERTEX`."""
    vertices["in_position"] = mesh.positions
    vertices["in_color"] = 1.0
    if mesh.normals is not None:
        vertices["in_normal"] = mesh.normals
    if mesh.texture_coordinates is not None:
        vertices["in_texture_coordinate"] = mesh.texture_coordinates
    if mesh.colors is not None:
        vertices["in_color"] = mesh.colors


def vertex_array(
    context: moderngl.Context,
    program: moderngl.Program,
    vertices: moderngl.Buffer,
    indices: moderngl.Buffer,
) -> moderngl.VertexArray:
    """Vertex array that feeds a program; attributes it does not use are skipped."""
    layout, names = [], []
    for name in VERTEX.names or ():
        size, attribute = VERTEX[name].shape[0], name
        if name == _IN_PLACE_OF and _LIGHT in program:
            attribute = _LIGHT
        if attribute in program:
            layout.append(_FORMATS[size])
            names.append(attribute)
        else:
            layout.append(f"{VERTEX[name].itemsize}x")
    content = [(vertices, " ".join(layout), *names)]
    return context.vertex_array(program, content, indices, index_element_size=4)
