"""The scene's triangles as textures: what looks up single ones finds them quickest there."""

from __future__ import annotations

from typing import TYPE_CHECKING

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.errors import GraphicsError
from omnisim.gpu.scene.adjacency import NO_NEIGHBOUR, neighbours
from omnisim.scene.model import AlphaMode, Material

if TYPE_CHECKING:
    from omnisim.gpu.scene.scene_buffers import SceneBuffers

ROW_BITS = 12  # of entries in a row of a texture, as in shaders/ground_truth/tables.glsl
_AT_ONCE = 1 << 18  # entries: what is in between stays small
_CORNER = np.dtype([("position", "<f4", 3), ("neighbour", "<u4")])


class TriangleTable:
    """Corners of all triangles, in the order of the index buffer.

    Args:
        buffers: the scene and its dynamic objects.

    Attributes:
        corners: texture of four integers an entry: of each corner the position, in the frame of
            its mesh, as bits of floats, and the triangle beyond the opposite edge, counted in its
            draw (`omnisim.gpu.scene.adjacency`). Blended draws have no neighbours.
        indices: buffer of the vertices of the corners. The scene's own, unless that is sorted anew
            in every frame, as that of blended draws is.

    Raises:
        GraphicsError: more triangles than fit on the GPU.
    """

    def __init__(self, buffers: SceneBuffers):
        context = buffers.context
        count = buffers.indices.size // 4
        self.corners = table_texture(context, count, "the scene's triangles")
        some_sorted = any(_is_sorted(draw.material) for draw in buffers.draw_items)
        self.indices = context.buffer(reserve=4 * count) if some_sorted else buffers.indices
        beside_of_mesh: dict[int, NDArray[np.uint32]] = {}
        # whole rows are written at once: those of the draws before that are not full wait
        waiting, first_row = [np.empty(0, dtype=_CORNER)], 0
        first = 0
        for draw in sorted(buffers.draw_items, key=lambda draw: draw.first):
            if draw.first < first:  # instances share the triangles of their mesh
                continue
            first = draw.first + draw.count
            mesh = draw.mesh
            if some_sorted:
                indices = (mesh.triangles.ravel() + np.uint32(draw.base)).astype("<u4")
                self.indices.write(indices, offset=4 * draw.first)
            corners = np.empty(draw.count, dtype=_CORNER)
            corners["position"] = mesh.positions[mesh.triangles.ravel()]
            corners["neighbour"] = NO_NEIGHBOUR
            if not _is_sorted(draw.material):
                if id(mesh) not in beside_of_mesh:
                    beside_of_mesh[id(mesh)] = neighbours(mesh.positions, mesh.triangles)
                corners["neighbour"] = beside_of_mesh[id(mesh)].ravel()
            waiting.append(corners)
            if sum(map(len, waiting)) >= _AT_ONCE:
                first_row, left = _write_rows(self.corners, np.concatenate(waiting), first_row)
                waiting = [left]
        write_table(self.corners, np.concatenate(waiting), first_row)


def _is_sorted(material: Material) -> bool:
    return material.alpha_mode is AlphaMode.BLEND


def table_texture(context: moderngl.Context, entries: int, what: str) -> moderngl.Texture:
    """A texture of so many entries of four integers, row by row.

    Raises:
        GraphicsError: it does not fit on the GPU; names what it was meant for.
    """
    rows = max(1, -(-entries >> ROW_BITS))
    size = (1 << ROW_BITS if rows > 1 else max(entries, 1), rows)
    try:
        texture = context.texture(size, 4, dtype="u4")
    except moderngl.Error as reason:
        raise GraphicsError(
            f"{what} take {16 * entries} bytes, which do not fit on this GPU ({reason})"
        ) from None
    texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
    return texture


def write_table(texture: moderngl.Texture, values: NDArray[np.void], first_row: int = 0) -> None:
    """Write the entries of a table, from a row on."""
    row, left = _write_rows(texture, values, first_row)
    if len(left):
        entries = np.zeros((texture.width, 4), dtype="<u4")
        entries[: len(left)] = left.view("<u4").reshape(-1, 4)
        texture.write(entries, viewport=(0, row, texture.width, 1))


def _write_rows(
    texture: moderngl.Texture, values: NDArray[np.void], first_row: int
) -> tuple[int, NDArray[np.void]]:
    """Write as many entries as fill rows; return the row that follows, and what is left."""
    flat = np.ascontiguousarray(values).view(_CORNER).ravel()
    rows = len(flat) // texture.width
    if rows:
        written = flat[: rows * texture.width]
        texture.write(written, viewport=(0, first_row, texture.width, rows))
    return first_row + rows, flat[rows * texture.width :]
