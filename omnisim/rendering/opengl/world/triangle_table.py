"""Scene triangles in textures, the fastest way for shaders to look up single ones."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Floats32, Uints32
from omnisim.rendering.opengl.gl.buffers import written_buffer
from omnisim.rendering.opengl.gl.gpu_textures import texture_2d
from omnisim.rendering.opengl.gl.memory import gpu_allocation
from omnisim.rendering.opengl.world.geometry_store import IndexRange

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
        self._is_sorted = any(one.is_blended for one in ranges)
        self.indices = written_buffer(context, 4 * count) if self._is_sorted else indices
        self._written, self._row, self._rest = 0, 0, np.empty(0, dtype=_CORNER)
        self._write(ranges)

    def append(self, ranges: Sequence[IndexRange], indices: moderngl.Buffer) -> bool:
        """Append new ranges; False: there is no room, and the caller needs a new table."""
        more = ranges[self._written :]
        if not more:
            return True
        is_sorted = self._is_sorted or any(one.is_blended for one in more)
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
    if all(one.size <= size for one in buffers):
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
