"""The scene's triangles as textures: the quickest way for shaders to look up single ones."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.gpu.memory import gpu_allocation
from omnisim.gpu.scene.adjacency import NO_NEIGHBOUR, neighbours
from omnisim.gpu.scene.draw_item import DrawItem

ROW_BITS = 12  # of entries in a row of a texture, as in shaders/ground_truth/tables.glsl
_ENTRIES_AT_ONCE = 1 << 18  # so that memory in between stays small
_CORNER = np.dtype([("position", "<f4", 3), ("neighbour", "<u4")])


class TriangleTable:
    """Corners of all triangles, in the order of the index buffer.

    Args:
        context: where.
        draw_items: of the scene.
        indices: the scene's index buffer.

    Attributes:
        corners: texture of four integers an entry: of each corner the position, in the frame of
            its mesh, as bits of floats, and the triangle beyond the opposite edge, counted in its
            draw item (`omnisim.gpu.scene.adjacency`). Blended items have no neighbours.
        indices: buffer of the vertices of the corners. The scene's own, unless blended items sort
            that anew in every frame.

    Raises:
        GraphicsError: more triangles than fit on the GPU.
    """

    def __init__(
        self,
        context: moderngl.Context,
        draw_items: Sequence[DrawItem],
        indices: moderngl.Buffer,
    ):
        count = indices.size // 4
        self.corners = table_texture(context, count, "the scene's triangles")
        is_sorted = any(item.is_blended for item in draw_items)
        self.indices = context.buffer(reserve=4 * count) if is_sorted else indices
        neighbours_of_mesh: dict[int, NDArray[np.uint32]] = {}
        # whole rows are written at once: the rest of the items before waits
        waiting, row = [np.empty(0, dtype=_CORNER)], 0
        first = 0
        for item in sorted(draw_items, key=lambda item: item.first):
            if item.first < first:  # instances share the triangles of their mesh
                continue
            first = item.first + item.count
            mesh = item.mesh
            if is_sorted:
                own = (mesh.triangles.ravel() + np.uint32(item.base)).astype("<u4")
                self.indices.write(own, offset=4 * item.first)
            corners = np.empty(item.count, dtype=_CORNER)
            corners["position"] = mesh.positions[mesh.triangles.ravel()]
            corners["neighbour"] = NO_NEIGHBOUR
            if not item.is_blended:
                if id(mesh) not in neighbours_of_mesh:
                    neighbours_of_mesh[id(mesh)] = neighbours(mesh.positions, mesh.triangles)
                corners["neighbour"] = neighbours_of_mesh[id(mesh)].ravel()
            waiting.append(corners)
            if sum(map(len, waiting)) >= _ENTRIES_AT_ONCE:
                row, rest = _write_rows(self.corners, np.concatenate(waiting), row)
                waiting = [rest]
        write_table(self.corners, np.concatenate(waiting), row)


def table_texture(context: moderngl.Context, entries: int, content: str) -> moderngl.Texture:
    """Texture of so many entries of four integers, row by row.

    Raises:
        GraphicsError: it does not fit on the GPU; names its content.
    """
    rows = max(1, -(-entries >> ROW_BITS))
    size = (1 << ROW_BITS if rows > 1 else max(entries, 1), rows)
    with gpu_allocation(f"a table of {16 * entries} bytes for {content}", "make the scene smaller"):
        texture = context.texture(size, 4, dtype="u4")
    texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
    return texture


def write_table(texture: moderngl.Texture, values: NDArray[np.void], first_row: int = 0) -> None:
    """Write the entries of a table, from a row on."""
    row, rest = _write_rows(texture, values, first_row)
    if len(rest):
        entries = np.zeros((texture.width, 4), dtype="<u4")
        entries[: len(rest)] = rest.view("<u4").reshape(-1, 4)
        texture.write(entries, viewport=(0, row, texture.width, 1))


def _write_rows(
    texture: moderngl.Texture, values: NDArray[np.void], first_row: int
) -> tuple[int, NDArray[np.void]]:
    """Write as many entries as fill rows; return the row that follows, and the rest."""
    flat = np.ascontiguousarray(values).view(_CORNER).ravel()
    rows = len(flat) // texture.width
    if rows:
        written = flat[: rows * texture.width]
        texture.write(written, viewport=(0, first_row, texture.width, rows))
    return first_row + rows, flat[rows * texture.width :]
