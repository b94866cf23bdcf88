"""Vertex format of the scene's buffers, and the vertex arrays that feed programs with it."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.scene.model import Mesh
from omnisim.scene.parts import LightRectangle

VERTEX = np.dtype(  # read word by word in shaders/scene/vertex_words.glsl
    [
        ("in_position", "<f4", 3),
        ("in_normal", "<f4", 3),  # zero: flat, the triangle's own; or in_light, see below
        ("in_texture_coordinate", "<f4", 2),
        ("in_color", "<f2", 4),
    ]
)
CLUSTER_VERTEX = np.dtype(  # of clusters: with its material, whatever draw call it is in
    [
        ("in_position", "<f4", 3),
        ("in_normal", "<f4", 3),
        ("in_texture_coordinate", "<f4", 2),
        ("in_color", "<f4", 4),  # times the base colour
        ("in_material", "<f4", 2),  # layer of the texture array, and cutoff of alpha
    ]
)
INSTANCE = np.dtype(  # of an object in a view, as in shaders/culling/views.glsl
    [
        ("in_clip_from_object", "<f4", (4, 4)),
        ("in_placement", "<f4", 4),
        ("in_viewpoint_from_object", "<f4", (3, 4)),
        ("viewpoint", "<f4", 4),  # of culling alone
    ]
)
# Of attributes of clusters, as in shaders/scene/vertex.glsl.
_FIRST_LOCATION, _LIGHT_COORDINATE_LOCATION, _FIRST_INSTANCE_LOCATION = 0, 5, 6
_ATTRIBUTE = "in_"
# Attribute of baked triangles, stored in the place of another one.
_LIGHT, _IN_PLACE_OF = "in_light", "in_normal"
# Attribute of a buffer of its own, which only scenes with baked light have.
_LIGHT_COORDINATE = "in_light_coordinate"


def fill_vertices(vertices: NDArray[np.void], mesh: Mesh) -> None:
    """Write the vertices of a mesh into as many of `VERTEX` or `CLUSTER_VERTEX`."""
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
    light_coordinates: moderngl.Buffer | None = None,
) -> moderngl.VertexArray:
    """Vertex array that feeds a program; attributes it does not use are skipped."""
    content = [(vertices, *_layout(program, VERTEX)), *_light(program, light_coordinates)]
    return context.vertex_array(program, content, indices, index_element_size=4)


def cluster_vertex_array(
    context: moderngl.Context,
    program: moderngl.Program,
    vertices: moderngl.Buffer,
    indices: moderngl.Buffer,
    instances: moderngl.Buffer,
    light_coordinates: moderngl.Buffer | None = None,
) -> moderngl.VertexArray:
    """Vertex array of `CLUSTER_VERTEX`, whose base instance is an entry of `INSTANCE`.

    It feeds all programs of clusters, as their attributes have the same locations: a change of
    program is none of vertex arrays. Moderngl asks for one of them.
    """
    array = context.vertex_array(program, [], indices, index_element_size=4)
    _bind_attributes(array, vertices, CLUSTER_VERTEX, _FIRST_LOCATION)
    if light_coordinates is not None:
        array.bind(_LIGHT_COORDINATE_LOCATION, "f", light_coordinates, "4f4", 0, 16)
    _bind_attributes(array, instances, INSTANCE, _FIRST_INSTANCE_LOCATION, divisor=1)
    return array


def _bind_attributes(
    array: moderngl.VertexArray,
    buffer: moderngl.Buffer,
    record: np.dtype[np.void],
    location: int,
    divisor: int = 0,
) -> None:
    """Bind the fields of a record to locations that follow each other, one for each row."""
    for name, (field, offset, *_) in (record.fields or {}).items():
        rows, columns = field.shape if len(field.shape) == 2 else (1, *field.shape)
        for row in range(rows if name.startswith(_ATTRIBUTE) else 0):
            at = offset + row * columns * field.base.itemsize
            form = f"{columns}f{field.base.itemsize}"
            array.bind(location, "f", buffer, form, at, record.itemsize, divisor)
            location += 1


def light_coordinates(
    parts: Sequence[tuple[int, Mesh, Sequence[LightRectangle]]], count: int
) -> NDArray[np.float32]:
    """Places (count, 4) of vertices in the lightmap, of both sides; negative: they have none.

    Args:
        parts: first vertex of a mesh, the mesh, and its rectangles of front and back, if any.
        count: of all vertices.
    """
    places = np.full((count, 4), -1.0, dtype=np.float32)
    for base, mesh, rectangles in parts:
        of_mesh = places[base : base + len(mesh.positions)]
        for side, rectangle in enumerate(rectangles):
            if mesh.light_coordinates is not None:
                within = mesh.light_coordinates * np.array(rectangle[2:])
                of_mesh[:, 2 * side : 2 * side + 2] = np.array(rectangle[:2]) + within
    return places


def _light(
    program: moderngl.Program, light_coordinates: moderngl.Buffer | None
) -> list[tuple[moderngl.Buffer, str, str]]:
    if light_coordinates is None or _LIGHT_COORDINATE not in program:
        return []
    attribute = program[_LIGHT_COORDINATE]
    is_one_side = isinstance(attribute, moderngl.Attribute) and attribute.dimension == 2
    return [(light_coordinates, "2f4 8x" if is_one_side else "4f4", _LIGHT_COORDINATE)]


def _layout(program: moderngl.Program, vertex: np.dtype[np.void]) -> list[str]:
    """Format of a buffer, and the names of the attributes that a program uses."""
    layout, names = [], []
    for name in vertex.names or ():
        field = vertex[name]
        attribute = _LIGHT if name == _IN_PLACE_OF and _LIGHT in program else name
        if attribute in program:
            layout.append(_format(field))
            names.append(attribute)
        else:
            layout.append(f"{field.itemsize}x")
    return [" ".join(layout), *names]


def _format(field: np.dtype[np.generic]) -> str:
    """moderngl's format of an attribute."""
    count = int(np.prod(field.shape))
    return f"{count}f{field.base.itemsize}"
