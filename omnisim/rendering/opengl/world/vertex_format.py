"""Vertex arrays that map the scene's buffers to program attributes, and palettes of vertices."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np

from omnisim.core.arrays import Floats32, Uints32
from omnisim.rendering.opengl.gl.buffers import gpu_allocation
from omnisim.rendering.opengl.gl.gpu_textures import texture_2d
from omnisim.rendering.opengl.world.vertex_records import CLUSTER_VERTEX, INSTANCE, VERTEX

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
    layout, names = [], []
    for name in VERTEX.names or ():
        field = VERTEX[name]
        if name in program:
            layout.append(f"{int(np.prod(field.shape))}f{field.base.itemsize}")
            names.append(name)
        else:
            layout.append(f"{field.itemsize}x")
    content = [(vertices, " ".join(layout), *names)]
    if light_coordinates is not None and _LIGHT_COORDINATE in program:
        attribute = program[_LIGHT_COORDINATE]
        is_one_side = isinstance(attribute, moderngl.Attribute) and attribute.dimension == 2
        form = "2f4 8x" if is_one_side else "4f4"
        content.append((light_coordinates, form, _LIGHT_COORDINATE))
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


# Palette of vertices: color, texture layer, alpha cutoff and baked light, each combination once.
#
# A vertex has an index of 4 bytes instead of 36 bytes of floats, and the same values to the last
# bit.
PALETTE_UNIT = 19  # as in shaders/scene/vertex_material.glsl, and so is the layout
_ROW_BITS = 14  # log2 of the texels per row: as many as all drivers allow, for many entries
_ONE_COLOR = np.ones((1, 4), dtype=np.float16)


class VertexPalette:
    """Collects the entries of vertices, for one texture.

    An entry begins with two texels: color, then layer and cutoff. A third one follows if light is
    baked into it: the color times the light. The index of an entry is that of its first texel.
    """

    def __init__(self) -> None:
        self._texels = np.zeros((1 << _ROW_BITS, 4), dtype=np.float32)
        self._used = 0
        self._indices: dict[tuple[object, ...], Uints32] = {}

    @property
    def texels(self) -> Floats32:
        """Texels (n, 4) of all entries."""
        return self._texels[: self._used]

    def add(
        self, colors: Floats32 | None, base_color: Sequence[float], layer: int, cutoff: float
    ) -> Uints32:
        """Indices of the vertices of a mesh with one material.

        Args:
            colors: (n, 4) linear vertex colors, kept alive by the caller; None: white.
            base_color: RGBA that multiplies them.
            layer: layer of the texture array.
            cutoff: alpha cutoff, or the kind of a blended material.

        Returns:
            Indices (n,), or (1,) for all vertices without colors of their own.
        """
        key = (id(colors), tuple(base_color), layer, cutoff)
        if key not in self._indices:
            # vertex colors are half floats, as in the scene's vertex buffer
            halves = _ONE_COLOR if colors is None else colors.astype(np.float16)
            found, entry = np.unique(halves.view(np.uint64).ravel(), return_inverse=True)
            entries = np.zeros((len(found), 2, 4), dtype=np.float32)
            entries[:, 0] = found.view(np.float16).reshape(-1, 4)
            entries[:, 0] *= np.array(base_color, dtype=np.float32)
            entries[:, 1, :2] = layer, cutoff
            self._indices[key] = self._append(entries)[entry]
        return self._indices[key]

    def lit(self, indices: Uints32, lights: Floats32) -> Uints32:
        """Indices (n,) of entries like others (n,), with lights (n, 3), linear RGB, baked in."""
        if not len(indices):
            return indices
        rows = np.column_stack((indices, lights.view(np.uint32)))
        # neighbors have mostly the same
        starts = np.append(True, (rows[1:] != rows[:-1]).any(axis=1))
        numbers = [  # of the halves of each row of four
            np.unique(half, return_inverse=True)[1].astype(np.uint64)
            for half in np.ascontiguousarray(rows[starts]).view(np.uint64).T
        ]
        pairs = numbers[0] << np.uint64(32) | numbers[1]
        _, first, entry = np.unique(pairs, return_index=True, return_inverse=True)
        at = np.flatnonzero(starts)[first]
        entries = np.empty((len(at), 3, 4), dtype=np.float32)
        entries[:, 0], entries[:, 1] = self._texels[indices[at]], self._texels[indices[at] + 1]
        entries[:, 2] = entries[:, 0]
        entries[:, 2, :3] *= lights[at]
        return self._append(entries)[entry[np.cumsum(starts) - 1]]

    def texture(self, context: moderngl.Context) -> moderngl.Texture:
        """Texture of the entries, row by row.

        Raises:
            GraphicsError: too many for the GPU.
        """
        rows = max(1, -(-self._used >> _ROW_BITS))
        padded = np.zeros((rows << _ROW_BITS, 4), dtype=np.float32)
        padded[: self._used] = self.texels
        with gpu_allocation(f"a palette of {self._used} texels", "make the scene smaller"):
            return texture_2d(context, (1 << _ROW_BITS, rows), 4, padded)

    def _append(self, entries: Floats32) -> Uints32:
        """Append entries (n, texels, 4), and return their indices (n,)."""
        count, texels, _ = entries.shape
        first, self._used = self._used, self._used + count * texels
        if self._used > len(self._texels):
            more = np.zeros((self._used, 4), dtype=np.float32)
            self._texels = np.concatenate((self._texels, more))
        self._texels[first : self._used] = entries.reshape(-1, 4)
        return np.arange(first, self._used, texels, dtype=np.uint32)
