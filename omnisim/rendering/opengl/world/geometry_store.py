"""Meshes on the GPU: vertices, indices, and a table of triangles for lookups.

Each mesh is uploaded once, when it is first needed. Clusters have their own vertices: most meshes
are needed here for ground truth and ranges only.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Floats32, Uints32
from omnisim.rendering.opengl.gl.buffers import gpu_allocation, gpu_buffer, written_buffer
from omnisim.rendering.opengl.gl.gpu_textures import texture_2d
from omnisim.rendering.opengl.world.draw_item import DrawItem
from omnisim.rendering.opengl.world.vertex_records import VERTEX, light_coordinates
from omnisim.scene.model import Mesh, Scene
from omnisim.scene.surface_kind import SurfaceKind, kind_of

# Vertices and indices that edits may append beyond the initial number.
MIN_SPARE = 1 << 18

GeometryKey = tuple[int, ...]  # identity of a mesh's arrays


class IndexRange(NamedTuple):
    """Indices of a mesh in the index buffer."""

    mesh: Mesh  # mesh that owns the triangles
    first: int  # first index
    base: int  # first vertex of the mesh
    is_blended: bool  # True for the range of one blended item, which re-sorts it in every frame


def geometry_key(mesh: Mesh) -> GeometryKey:
    """Identity of a mesh's arrays, which meshes with other materials may share."""
    arrays = (mesh.positions, mesh.triangles, mesh.normals, mesh.texture_coordinates, mesh.colors)
    others = (mesh.second_texture_coordinates, mesh.deformation, mesh.light_coordinates)
    return tuple(map(id, (*arrays, *others)))


class GeometryStore:
    """Places the meshes of scenes in two buffers, and further ones later; uploads them on demand.

    Instances share the indices of their mesh, except blended ones, which are sorted individually.

    Attributes:
        ranges: consecutive ranges of all indices.
        offsets: first index and first vertex of each scene's instances.
    """

    def __init__(self, context: moderngl.Context, parts: Sequence[Scene]):
        self._context = context
        self._vertex_count, self.ranges, self.offsets = _place_meshes(parts)
        self._index_count = sum(index_range.mesh.triangles.size for index_range in self.ranges)
        self._limit = 2 * (self._vertex_count + self._index_count) + MIN_SPARE
        self._buffers: tuple[moderngl.Buffer, moderngl.Buffer] | None = None
        self._complete = 0  # number of ranges that are all uploaded
        # first vertices and first indices of what is uploaded
        self._uploaded_bases, self._uploaded = set[int](), set[int]()
        # ranges keep the meshes alive, so that no other array gets the id of one of theirs
        self._base: dict[GeometryKey, int] = {}
        self._shared: dict[GeometryKey, int] = {}
        self._free: dict[GeometryKey, list[int]] = {}
        for index_range in self.ranges:
            self._register(index_range)

    @property
    def sizes(self) -> tuple[int, int]:
        """Bytes of the buffers of vertices and indices, allocated or not."""
        if self._buffers is not None:
            return self._buffers[0].size, self._buffers[1].size
        vertices = VERTEX.itemsize * self._vertex_count
        return max(vertices, VERTEX.itemsize), max(4 * self._index_count, VERTEX.itemsize)

    @property
    def allocated(self) -> tuple[moderngl.Buffer, moderngl.Buffer]:
        """Buffers of vertices and indices, with what is uploaded so far.

        Raises:
            GraphicsError: they do not fit on the GPU.
        """
        if self._buffers is None:
            sizes = self.sizes
            with gpu_allocation(f"{sum(sizes)} bytes for the scene", "make the scene smaller"):
                vertices, indices = (written_buffer(self._context, size) for size in sizes)
            self._buffers = vertices, indices
        return self._buffers

    def upload(self, items: Sequence[DrawItem]) -> tuple[moderngl.Buffer, moderngl.Buffer]:
        """Buffers of vertices and indices, with those of some items."""
        firsts, bases = {item.first for item in items}, {item.base for item in items}
        self._upload(
            [
                index_range
                for index_range in self.ranges
                if index_range.first in firsts or index_range.base in bases
            ]
        )
        return self.allocated

    def upload_all(self) -> tuple[moderngl.Buffer, moderngl.Buffer]:
        """Buffers of vertices and indices, with those of all ranges."""
        if self._complete < len(self.ranges):  # a frame with ground truth asks several times
            self._upload(self.ranges)
            self._complete = len(self.ranges)
        return self.allocated

    def _upload(self, ranges: Sequence[IndexRange]) -> None:
        """Upload what is missing; the GPU may have changed the rest since."""
        for index_range in ranges:
            if index_range.mesh.triangles.size and index_range.first not in self._uploaded:
                self.allocated[1].write(_indices(index_range), offset=4 * index_range.first)
                self._uploaded.add(index_range.first)
            if len(index_range.mesh.positions) and index_range.base not in self._uploaded_bases:
                offset = VERTEX.itemsize * index_range.base
                self.allocated[0].write(_vertices(index_range.mesh), offset=offset)
                self._uploaded_bases.add(index_range.base)

    @property
    def is_overgrown(self) -> bool:
        """True if edits appended more than the initial size, and more than is worth keeping."""
        return self._vertex_count + self._index_count > self._limit

    def light_coordinates(self) -> moderngl.Buffer:
        """Upload the light coordinates of all vertices."""
        whole = (0.0, 0.0, 1.0, 1.0)
        parts = [
            (index_range.base, index_range.mesh, (whole, whole)) for index_range in self.ranges
        ]
        return gpu_buffer(self._context, light_coordinates(parts, self._vertex_count))

    def place(self, mesh: Mesh, is_blended: bool) -> tuple[int, int]:
        """First index and first vertex for another instance of a mesh; appends a new mesh."""
        key = geometry_key(mesh)
        if key not in self._base:
            vertices, indices = self.allocated
            self._base[key] = self._vertex_count
            used = self._vertex_count * VERTEX.itemsize
            self._buffers = self._append(vertices, used, _vertices(mesh)), indices
            self._uploaded_bases.add(self._vertex_count)
            self._vertex_count += len(mesh.positions)
        if is_blended and self._free.get(key):
            return self._free[key].pop(), self._base[key]
        if is_blended or key not in self._shared:
            added = IndexRange(mesh, self._index_count, self._base[key], is_blended)
            vertices, indices = self.allocated
            self._buffers = vertices, self._append(indices, 4 * added.first, _indices(added))
            self._uploaded.add(added.first)
            self._index_count += mesh.triangles.size
            self.ranges.append(added)
            self._register(added)
            return added.first, added.base
        return self._shared[key], self._base[key]

    def release(self, item: DrawItem) -> None:
        """Release the indices of a blended item that was removed."""
        if item.is_blended:
            self._free.setdefault(geometry_key(item.mesh), []).append(item.first)

    def _register(self, added: IndexRange) -> None:
        key = geometry_key(added.mesh)
        self._base.setdefault(key, added.base)
        if not added.is_blended:
            self._shared.setdefault(key, added.first)

    def _append(
        self, buffer: moderngl.Buffer, used: int, values: NDArray[np.generic]
    ) -> moderngl.Buffer:
        """Write values behind the used bytes of a buffer, or of a larger copy of it."""
        end = used + values.nbytes
        if end > buffer.size:
            with gpu_allocation(f"{2 * end} bytes for the scene", "make the scene smaller"):
                larger = written_buffer(self._context, 2 * end)
            self._context.copy_buffer(larger, buffer, size=used)
            buffer = larger
        buffer.write(values, offset=used)
        return buffer


def _vertices(mesh: Mesh) -> NDArray[np.void]:
    """Vertices (n,) of type `VERTEX` of a mesh."""
    vertices = np.zeros(len(mesh.positions), dtype=VERTEX)
    vertices["in_position"] = mesh.positions
    vertices["in_color"] = 1.0 if mesh.colors is None else mesh.colors
    if mesh.normals is not None:
        vertices["in_normal"] = mesh.normals
    if mesh.texture_coordinates is not None:
        vertices["in_texture_coordinate"] = mesh.texture_coordinates
    return vertices


def _indices(index_range: IndexRange) -> Uints32:
    """Indices of a range, as indices into the vertex buffer."""
    return (index_range.mesh.triangles.ravel() + np.uint32(index_range.base)).astype("<u4")


def _place_meshes(
    parts: Sequence[Scene],
) -> tuple[int, list[IndexRange], list[list[tuple[int, int]]]]:
    """Place all meshes one after the other; instances share indices, except blended ones.

    Returns:
        Number of vertices, ranges, and first index and first vertex of each scene's instances.
    """
    ranges: list[IndexRange] = []
    offsets: list[list[tuple[int, int]]] = []
    base = first = 0
    for part in parts:
        *bases, base = accumulate((len(mesh.positions) for mesh in part.meshes), initial=base)
        shared: dict[int, int] = {}
        offsets.append([])
        for instance in part.instances:
            mesh = part.meshes[instance.mesh]
            is_blended = bool(kind_of(part.materials[mesh.material]) & SurfaceKind.SEE_THROUGH)
            if is_blended or instance.mesh not in shared:
                ranges.append(IndexRange(mesh, first, bases[instance.mesh], is_blended))
                shared[instance.mesh] = first
                first += mesh.triangles.size
            offsets[-1].append((shared[instance.mesh], bases[instance.mesh]))
    return base, ranges, offsets


# Scene triangles in textures, the fastest way for shaders to look up single ones.
ROW_BITS = 12  # log2 of the entries per row, as in shaders/ground_truth/tables.glsl
_ENTRIES_AT_ONCE = 1 << 18  # keeps intermediate arrays small
_CORNER = np.dtype([("position", "<f4", 3), ("neighbor", "<u4")])


class TriangleTable:
    """Corners of all triangles, in the order of the index buffer.

    Args:
        indices: index buffer of the scene.

    Attributes:
        corners: texture with four integers per corner: its position in the mesh's frame as float
            bits, and the triangle beyond the opposite edge, counted within the mesh
            (`neighbors`). Blended items have no adjacency.
        indices: vertex index per corner: the scene's index buffer, or a copy if blended items
            re-sort that in every frame.

    Raises:
        GraphicsError: more triangles than fit on the GPU.
    """

    def __init__(
        self, context: moderngl.Context, ranges: Sequence[IndexRange], indices: moderngl.Buffer
    ):
        count = indices.size // 4
        self.corners = table_texture(context, count, "the scene's triangles")
        self._is_sorted = any(index_range.is_blended for index_range in ranges)
        self.indices = written_buffer(context, 4 * count) if self._is_sorted else indices
        self._written, self._row, self._rest = 0, 0, np.empty(0, dtype=_CORNER)
        self._write(ranges)

    def append(self, ranges: Sequence[IndexRange], indices: moderngl.Buffer) -> bool:
        """Append new ranges; False: there is no room, and the caller needs a new table."""
        more = ranges[self._written :]
        if not more:
            return True
        is_sorted = self._is_sorted or any(index_range.is_blended for index_range in more)
        if is_sorted or indices is not self.indices:
            return False
        self._write(more)
        return True

    def _write(self, ranges: Sequence[IndexRange]) -> None:
        neighbors_of_mesh: dict[int, Uints32] = {}
        # whole rows only: the rest of the previous ranges waits
        waiting, row = [self._rest], self._row
        for mesh, first, base, is_blended in ranges:
            if self._is_sorted:
                own = (mesh.triangles.ravel() + np.uint32(base)).astype("<u4")
                self.indices.write(own, offset=4 * first)
            corners = np.empty(mesh.triangles.size, dtype=_CORNER)
            corners["position"] = mesh.positions[mesh.triangles.ravel()]
            corners["neighbor"] = NO_NEIGHBOR
            if not is_blended:
                if id(mesh) not in neighbors_of_mesh:
                    neighbors_of_mesh[id(mesh)] = neighbors(mesh.positions, mesh.triangles)
                corners["neighbor"] = neighbors_of_mesh[id(mesh)].ravel()
            waiting.append(corners)
            if sum(map(len, waiting)) >= _ENTRIES_AT_ONCE:
                row, rest = _write_rows(self.corners, np.concatenate(waiting), row)
                waiting = [rest]
        self._row, self._rest = write_table(self.corners, np.concatenate(waiting), row)
        self._written += len(ranges)


def table_texture(context: moderngl.Context, entries: int, content: str) -> moderngl.Texture:
    """Texture for `entries` entries of four integers, row by row.

    Raises:
        GraphicsError: too large for the GPU; names the content.
    """
    rows = max(1, -(-entries >> ROW_BITS))
    size = (1 << ROW_BITS if rows > 1 else max(entries, 1), rows)
    with gpu_allocation(f"a table of {16 * entries} bytes for {content}", "make the scene smaller"):
        return texture_2d(context, size, 4, dtype="u4")


def write_table(
    texture: moderngl.Texture, values: NDArray[np.void], first_row: int = 0
) -> tuple[int, NDArray[np.void]]:
    """Write a table's entries from a row on; return the incomplete last row and its entries."""
    row, rest = _write_rows(texture, values, first_row)
    if len(rest):
        entries = np.zeros((texture.width, 4), dtype="<u4")
        entries[: len(rest)] = rest.view("<u4").reshape(-1, 4)
        texture.write(entries, viewport=(0, row, texture.width, 1))
    return row, rest


def _write_rows(
    texture: moderngl.Texture, values: NDArray[np.void], first_row: int
) -> tuple[int, NDArray[np.void]]:
    """Write as many entries as fill rows; return the next row and the remaining entries."""
    flat = np.ascontiguousarray(values).view(_CORNER).ravel()
    rows = len(flat) // texture.width
    if rows:
        written = flat[: rows * texture.width]
        texture.write(written, viewport=(0, first_row, texture.width, rows))
    return first_row + rows, flat[rows * texture.width :]


# Vertex and index buffers for shaders, in windows if they exceed the size of a binding.
#
# The bindings are those of shaders/scene/vertex_words.glsl.
MAX_WINDOWS = 3
_FIRST_BINDINGS = (0, 1)
_MORE_BINDINGS = (8, 10)


def window_bytes(context: moderngl.Context) -> int:
    """Size of a window: the largest power of two that a shader may read."""
    limit = int(context.info["GL_MAX_SHADER_STORAGE_BLOCK_SIZE"])
    return 1 << (limit.bit_length() - 1)


def window_defines(context: moderngl.Context, *buffers: moderngl.Buffer) -> tuple[str, ...]:
    """Defines of shaders that read buffers; empty if each fits into one binding."""
    size = window_bytes(context)
    if all(buffer.size <= size for buffer in buffers):
        return ()
    return (f"WINDOW_WORD_BITS {size.bit_length() - 3}",)


def bind_triangles(
    context: moderngl.Context, vertices: moderngl.Buffer, indices: moderngl.Buffer
) -> None:
    """Bind vertices and indices, in at most `MAX_WINDOWS` windows each."""
    size = window_bytes(context)
    for buffer, first, more in zip(
        (vertices, indices), _FIRST_BINDINGS, _MORE_BINDINGS, strict=True
    ):
        if buffer.size <= size:
            buffer.bind_to_storage_buffer(first)
            continue
        for number in range(MAX_WINDOWS):
            # windows past the end are never read, but must be bound, because shaders declare them
            start = number * size if number * size < buffer.size else 0
            binding = more + number - 1 if number else first
            buffer.bind_to_storage_buffer(binding, start, min(size, buffer.size - start))


# Adjacency of a mesh's triangles by the positions of their corners.
NO_NEIGHBOR = np.uint32(0xFFFFFFFF)


def neighbors(positions: Floats32, triangles: Uints32) -> Uints32:
    """Adjacent triangles (m, 3) beyond the edges opposite to each triangle's corners.

    Corners at the same place count as one, even if normals or texture coordinates differ. If more
    than two triangles share an edge, each gets the next one; `NO_NEIGHBOR`: an open edge.

    Args:
        positions: (n, 3) positions of the vertices.
        triangles: (m, 3) vertex indices.
    """
    if not len(triangles):
        return np.empty((0, 3), dtype=np.uint32)
    points = np.ascontiguousarray(positions + np.float32(0.0))  # turns −0 into 0
    _, corners = np.unique(points.view("V12").ravel(), return_inverse=True)
    edges = corners[triangles][:, [[1, 2], [2, 0], [0, 1]]].reshape(-1, 2)
    edges = np.sort(edges, axis=1).astype(np.int64)
    keys = edges[:, 0] * len(positions) + edges[:, 1]
    order = np.argsort(keys, kind="stable")
    starts = np.flatnonzero(np.diff(keys[order], prepend=-1))
    counts = np.diff(starts, append=len(keys))
    following = np.arange(1, len(keys) + 1)
    following[starts + counts - 1] = starts  # the last one gets the first
    adjacent = np.full(len(keys), NO_NEIGHBOR)
    is_shared = np.repeat(counts > 1, counts)
    adjacent[order[is_shared]] = order[following[is_shared]] // 3
    return adjacent.reshape(-1, 3)
