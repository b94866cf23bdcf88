"""A vertex of the scene in a buffer of the GPU, and how a program is fed with it."""

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
# What a program asks for by the first name stands where the second does, of flat triangles.
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
    """The vertex array that feeds a program; attributes it does not use are skipped."""
    layout, names = [], []
    for name in VERTEX.names:
        kind, _ = VERTEX.fields[name]
        if name == _IN_PLACE_OF and _LIGHT in program:
            name = _LIGHT
        if name in program:
            layout.append(_FORMATS[kind.shape[0]])
            names.append(name)
        else:
            layout.append(f"{kind.itemsize}x")
    content = [(vertices, " ".join(layout), *names)]
    return context.vertex_array(program, content, indices, index_element_size=4)
