"""The scene's triangles as textures: what looks up single ones finds them quickest there."""

from __future__ import annotations

from typing import TYPE_CHECKING

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.errors import GraphicsError
from omnisim.gpu.adjacency import NO_NEIGHBOUR, neighbours
from omnisim.scene.model import AlphaMode, Material

if TYPE_CHECKING:
    from omnisim.gpu.scene_buffers import SceneBuffers

ROW_BITS = 12  # of entries in a row of a texture, as in shaders/ground_truth/tables.glsl
_CORNER = np.dtype([("position", "<f4", 3), ("neighbour", "<u4")])


class TriangleTable:
    """Corners of all triangles, in the order of the index buffer.

    Args:
        buffers: the scene and its movers.

    Attributes:
        corners: texture of four integers an entry: of each corner the position, in the frame of
            its mesh, as bits of floats, and the triangle beyond the opposite edge, counted in its
            draw (`omnisim.gpu.adjacency`). Blended draws have no neighbours.
        indices: buffer of the vertices of the corners. The scene's own, unless that is sorted anew
            in every frame, as that of blended draws is.

    Raises:
        GraphicsError: more triangles than fit on the GPU.
    """

    def __init__(self, buffers: SceneBuffers):
        context = buffers.context
        corners = np.zeros(buffers.indices.size // 4, dtype=_CORNER)
        indices = np.zeros(len(corners), dtype="<u4")
        of_mesh: dict[int, NDArray[np.uint32]] = {}
        done: set[int] = set()
        for draw in buffers.draws:
            if draw.first in done:
                continue
            done.add(draw.first)
            mesh = draw.mesh
            part = corners[draw.first : draw.first + draw.count]
            part["position"] = mesh.positions[mesh.triangles.ravel()]
            indices[draw.first : draw.first + draw.count] = mesh.triangles.ravel() + draw.base
            if _is_sorted(draw.material):
                part["neighbour"] = NO_NEIGHBOUR
                continue
            if id(mesh) not in of_mesh:
                of_mesh[id(mesh)] = neighbours(mesh.positions, mesh.triangles)
            part["neighbour"] = of_mesh[id(mesh)].ravel()
        self.corners = table_texture(context, len(corners), "the scene's triangles")
        write_table(self.corners, corners)
        some_sorted = any(_is_sorted(draw.material) for draw in buffers.draws)
        self.indices = context.buffer(indices) if some_sorted else buffers.indices


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


def write_table(texture: moderngl.Texture, values: NDArray[np.void]) -> None:
    """Write all entries of a table."""
    entries = np.ascontiguousarray(values).view("<u4").ravel()
    size = 4 * texture.width * texture.height
    if entries.size < size:  # the last row is not full
        entries = np.concatenate((entries, np.zeros(size - entries.size, dtype="<u4")))
    texture.write(entries)
