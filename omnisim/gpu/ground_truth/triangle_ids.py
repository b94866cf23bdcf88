"""Triangle IDs of a frame (visibility buffer), and a table of the triangles that they stand for.

A fragment knows only how many triangles of its draw call came before, and a call joins clusters of
many instances. So the calls of a frame count their triangles one after the other, the atlas holds
these IDs, and a table has the draw item and the triangle of each.
Source: Burns & Hunt, "The visibility buffer", 2013.
"""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.gpu.scene.draw_item import DrawItem
from omnisim.gpu.scene.scene_buffers import SceneBuffers
from omnisim.gpu.scene.static_geometry import StaticGeometry
from omnisim.gpu.scene.triangle_table import ROW_BITS

_ROW = 1 << ROW_BITS
_ENTRY = np.dtype([("item_plus_one", "<u4"), ("triangle", "<u4")])


class TriangleIds:
    """Table of a frame's triangle IDs: first of items drawn one by one, then of clusters.

    Args:
        buffers: the scene and its dynamic objects.
        one_by_one: (n,) draw items.

    Attributes:
        first_of_item: ID of the first triangle of each item that is drawn one by one.
        texture: two integers an ID: 1 + number of the draw item, and number of its triangle.
    """

    def __init__(self, buffers: SceneBuffers, one_by_one: NDArray[np.intp]):
        self._context, self._buffers = buffers.context, buffers
        self._geometry: StaticGeometry | None = None
        self._of_geometry = np.empty(0, dtype=_ENTRY)
        self.refresh(one_by_one)

    def refresh(self, one_by_one: NDArray[np.intp]) -> None:
        """Give IDs to what the buffers have now, of which these items are drawn one by one."""
        buffers = self._buffers
        items = one_by_one.tolist()
        counts = np.array([buffers.draw_items[item].triangles for item in items], dtype=np.int64)
        self.first_of_item = dict(zip(items, (np.cumsum(counts) - counts).tolist(), strict=True))
        self._fixed = _entries(buffers.draw_items, items)
        self._fixed_rows = -(-len(self._fixed) // _ROW)
        if self._geometry is not buffers.static_geometry:
            self._geometry = buffers.static_geometry
            self._of_geometry = self._fixed[:0]
            if self._geometry is not None:
                self._of_geometry = static_triangle_entries(self._geometry, buffers.draw_items)
        self._appended: list[NDArray[np.void]] = []
        self.texture = self._allocate(max(1, self._fixed_rows))

    def begin(self) -> None:
        """Begin a frame."""
        self._appended = []

    def append_clusters(self, clusters: NDArray[np.intp]) -> int:
        """Give the next IDs to the triangles of clusters (n,), and return the first."""
        if self._geometry is None:
            raise ValueError("no static geometry, no clusters")
        return self.append(self._of_geometry[self._geometry.triangles_of(clusters)])

    def append(self, entries: NDArray[np.void]) -> int:
        """Give the next IDs to triangles (n,), see `static_triangle_entries`; return the first."""
        first = _ROW * self._fixed_rows + sum(map(len, self._appended))
        self._appended.append(entries)
        count = sum(map(len, self._appended))
        rows = -(-count // _ROW)
        if self._fixed_rows + rows > self.texture.height:
            self.texture = self._allocate(self._fixed_rows + 2 * rows)
        padded = np.empty(rows * _ROW, dtype=_ENTRY)
        np.concatenate(self._appended, out=padded[:count])
        self.texture.write(padded, viewport=(0, self._fixed_rows, _ROW, rows))
        return first

    def _allocate(self, rows: int) -> moderngl.Texture:
        texture = self._context.texture((_ROW, rows), 2, dtype="u4")
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        if len(self._fixed):
            padded = np.zeros(self._fixed_rows * _ROW, dtype=_ENTRY)
            padded[: len(self._fixed)] = self._fixed
            texture.write(padded, viewport=(0, 0, _ROW, self._fixed_rows))
        return texture


def static_triangle_entries(
    geometry: StaticGeometry, draw_items: Sequence[DrawItem]
) -> NDArray[np.void]:
    """Table entries (n,) of the static geometry's triangles, in its order."""
    entries = _entries(draw_items, np.flatnonzero(geometry.contains).tolist())
    ordered: NDArray[np.void] = entries[geometry.hierarchy.order]
    return ordered


def _entries(draw_items: Sequence[DrawItem], items: list[int]) -> NDArray[np.void]:
    """Table entries (n,) of the triangles of some items."""
    counts = [draw_items[item].triangles for item in items]
    entries = np.empty(sum(counts), dtype=_ENTRY)
    entries["item_plus_one"] = np.repeat(np.array(items, dtype=np.intp) + 1, counts)
    entries["triangle"] = np.concatenate([np.empty(0, int), *map(np.arange, counts)])
    return entries
