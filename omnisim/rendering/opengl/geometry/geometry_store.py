"""Vertex and index buffers of a scene; each mesh is uploaded once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.opengl.geometry.draw_item import DrawItem
from omnisim.rendering.opengl.geometry.vertex_records import (
    VERTEX,
    fill_vertices,
    light_coordinates,
)
from omnisim.rendering.opengl.memory import gpu_allocation
from omnisim.scene.model import Mesh, Scene

# Vertices and indices that edits may append beyond the initial number.
MIN_SPARE = 1 << 18

GeometryKey = tuple[int, ...]


class IndexRange(NamedTuple):
    """Indices of a mesh in the index buffer.

    Attributes:
        mesh: mesh that owns the triangles.
        first: first index.
        base: first vertex of the mesh.
        is_blended: True for the range of one blended item, which re-sorts it in every frame.
    """

    mesh: Mesh
    first: int
    base: int
    is_blended: bool


def geometry_key(mesh: Mesh) -> GeometryKey:
    """Identity of a mesh's arrays, which meshes with other materials may share."""
    arrays = (mesh.positions, mesh.triangles, mesh.normals, mesh.texture_coordinates, mesh.colors)
    others = (mesh.second_texture_coordinates, mesh.deformation, mesh.light_coordinates)
    return tuple(map(id, (*arrays, *others)))


class GeometryStore:
    """Uploads the meshes of scenes, and further ones later.

    Instances share the indices of their mesh, except blended ones, which are sorted individually.

    Args:
        context: OpenGL context.
        parts: scenes to upload.

    Attributes:
        vertices, indices: the two buffers.
        ranges: consecutive ranges of all indices.
        offsets: first index and first vertex of each scene's instances.
    """

    def __init__(self, context: moderngl.Context, parts: Sequence[Scene]):
        self._context = context
        vertices, self.ranges, self.offsets = _concatenate_meshes(parts)
        indices = np.concatenate([np.empty(0, dtype="<u4"), *map(_indices, self.ranges)])
        self.vertices, self.indices = _buffer(context, vertices), _buffer(context, indices)
        self._vertex_count, self._index_count = len(vertices), len(indices)
        self._limit = 2 * (len(vertices) + len(indices)) + MIN_SPARE
        # ranges keep the meshes alive, so that no other array gets the id of one of theirs
        self._base: dict[GeometryKey, int] = {}
        self._shared: dict[GeometryKey, int] = {}
        self._free: dict[GeometryKey, list[int]] = {}
        for one in self.ranges:
            self._register(one)

    @property
    def is_overgrown(self) -> bool:
        """True if edits appended more than the initial size, and more than is worth keeping."""
        return self._vertex_count + self._index_count > self._limit

    def light_coordinates(self) -> moderngl.Buffer:
        """Upload the light coordinates of all vertices."""
        whole = (0.0, 0.0, 1.0, 1.0)
        parts = [(one.base, one.mesh, (whole, whole)) for one in self.ranges]
        return _buffer(self._context, light_coordinates(parts, self._vertex_count))

    def place(self, mesh: Mesh, is_blended: bool) -> tuple[int, int]:
        """First index and first vertex for another instance of a mesh; appends a new mesh."""
        key = geometry_key(mesh)
        if key not in self._base:
            vertices = np.zeros(len(mesh.positions), dtype=VERTEX)
            fill_vertices(vertices, mesh)
            self._base[key] = self._vertex_count
            used = self._vertex_count * VERTEX.itemsize
            self.vertices = self._append(self.vertices, used, vertices)
            self._vertex_count += len(vertices)
        if is_blended and self._free.get(key):
            return self._free[key].pop(), self._base[key]
        if is_blended or key not in self._shared:
            added = IndexRange(mesh, self._index_count, self._base[key], is_blended)
            self.indices = self._append(self.indices, 4 * added.first, _indices(added))
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
                larger = self._context.buffer(reserve=2 * end)
            self._context.copy_buffer(larger, buffer, size=used)
            buffer = larger
        buffer.write(values, offset=used)
        return buffer


def _buffer(context: moderngl.Context, values: NDArray[np.generic]) -> moderngl.Buffer:
    """Buffer of values; reserved for later if there are no values yet."""
    return context.buffer(values) if len(values) else context.buffer(reserve=VERTEX.itemsize)


def _indices(one: IndexRange) -> NDArray[np.uint32]:
    """Indices of a range, as indices into the vertex buffer."""
    return (one.mesh.triangles.ravel() + np.uint32(one.base)).astype("<u4")


def _concatenate_meshes(
    parts: Sequence[Scene],
) -> tuple[NDArray[np.void], list[IndexRange], list[list[tuple[int, int]]]]:
    """Concatenate all meshes; instances share indices, except blended ones.

    Returns:
        Vertices (n,), ranges, and first index and first vertex of each scene's instances.
    """
    vertices = np.zeros(
        sum(len(mesh.positions) for part in parts for mesh in part.meshes), dtype=VERTEX
    )
    ranges: list[IndexRange] = []
    offsets: list[list[tuple[int, int]]] = []
    base = first = 0
    for part in parts:
        bases = []
        for mesh in part.meshes:
            fill_vertices(vertices[base : base + len(mesh.positions)], mesh)
            bases.append(base)
            base += len(mesh.positions)
        shared: dict[int, int] = {}
        offsets.append([])
        for instance in part.instances:
            mesh = part.meshes[instance.mesh]
            is_blended = part.materials[mesh.material].is_see_through
            if is_blended or instance.mesh not in shared:
                ranges.append(IndexRange(mesh, first, bases[instance.mesh], is_blended))
                shared[instance.mesh] = first
                first += mesh.triangles.size
            offsets[-1].append((shared[instance.mesh], bases[instance.mesh]))
    return vertices, ranges, offsets
