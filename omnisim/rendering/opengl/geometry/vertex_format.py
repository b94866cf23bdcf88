"""Vertex arrays that map the records of the scene's buffers to program attributes."""

from __future__ import annotations

import moderngl
import numpy as np

from omnisim.rendering.opengl.geometry.vertex_records import CLUSTER_VERTEX, INSTANCE, VERTEX

# Attribute locations of cluster programs, as in shaders/scene/vertex.glsl.
_FIRST_LOCATION, _NORMAL_LOCATION, _LIGHT_COORDINATE_LOCATION, _FIRST_INSTANCE_LOCATION = 0, 3, 4, 5
_ATTRIBUTE = "in_"
# Attribute in a separate buffer, for scenes with baked light only.
_LIGHT_COORDINATE = "in_light_coordinate"


def vertex_array(
    context: moderngl.Context,
    program: moderngl.Program,
    vertices: moderngl.Buffer,
    indices: moderngl.Buffer,
    light_coordinates: moderngl.Buffer | None = None,
) -> moderngl.VertexArray:
    """Vertex array for a program; attributes that it does not use are skipped."""
    content = [(vertices, *_layout(program, VERTEX)), *_light(program, light_coordinates)]
    return context.vertex_array(program, content, indices, index_element_size=4)


def cluster_vertex_array(
    context: moderngl.Context,
    program: moderngl.Program,
    vertices: moderngl.Buffer,
    indices: moderngl.Buffer,
    instances: moderngl.Buffer,
    normals: moderngl.Buffer | None,
    light_coordinates: moderngl.Buffer | None = None,
) -> moderngl.VertexArray:
    """Vertex array of `CLUSTER_VERTEX`; the base instance selects an entry of `INSTANCE`.

    Normals are zero without a buffer of theirs: OpenGL's value of attributes that have none.

    All cluster programs use the same attribute locations, so that changing the program does not
    change the vertex array. Moderngl needs one of them to create it.
    """
    array = context.vertex_array(program, [], indices, index_element_size=4)
    _bind_attributes(array, vertices, CLUSTER_VERTEX, _FIRST_LOCATION)
    if normals is not None:
        array.bind(_NORMAL_LOCATION, "f", normals, "3f4", 0, 12)
    if light_coordinates is not None:
        array.bind(_LIGHT_COORDINATE_LOCATION, "f", light_coordinates, "4f4", 0, 16)
    _bind_attributes(array, instances, INSTANCE, _FIRST_INSTANCE_LOCATION, divisor=1)
    # Bound one by one, buffers are not kept alive by the array, and some drivers free the memory of
    # deleted ones that an array still uses.
    array.extra = vertices, instances, normals, light_coordinates
    return array


def _bind_attributes(
    array: moderngl.VertexArray,
    buffer: moderngl.Buffer,
    record: np.dtype[np.void],
    location: int,
    divisor: int = 0,
) -> None:
    """Bind the fields of a record to consecutive locations, one per matrix row."""
    for name, (field, offset, *_) in (record.fields or {}).items():
        rows, columns = (1, 1, *field.shape)[-2:]
        kind = "i" if field.base.kind == "u" else "f"
        for row in range(rows if name.startswith(_ATTRIBUTE) else 0):
            at = offset + row * columns * field.base.itemsize
            form = f"{columns}{field.base.kind}{field.base.itemsize}"
            array.bind(location, kind, buffer, form, at, record.itemsize, divisor)
            location += 1


def _light(
    program: moderngl.Program, light_coordinates: moderngl.Buffer | None
) -> list[tuple[moderngl.Buffer, str, str]]:
    if light_coordinates is None or _LIGHT_COORDINATE not in program:
        return []
    attribute = program[_LIGHT_COORDINATE]
    is_one_side = isinstance(attribute, moderngl.Attribute) and attribute.dimension == 2
    return [(light_coordinates, "2f4 8x" if is_one_side else "4f4", _LIGHT_COORDINATE)]


def _layout(program: moderngl.Program, vertex: np.dtype[np.void]) -> list[str]:
    """Buffer format, and the names of the attributes that a program uses."""
    layout, names = [], []
    for name in vertex.names or ():
        field = vertex[name]
        if name in program:
            layout.append(_format(field))
            names.append(name)
        else:
            layout.append(f"{field.itemsize}x")
    return [" ".join(layout), *names]


def _format(field: np.dtype[np.generic]) -> str:
    """Moderngl's format of an attribute."""
    count = int(np.prod(field.shape))
    return f"{count}f{field.base.itemsize}"
