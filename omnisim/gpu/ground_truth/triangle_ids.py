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
from omnisim.gpu.scene.static_geometry import StaticGeometry
from omnisim.gpu.scene.triangle_table import ROW_BITS

_ROW = 1 << ROW_BITS
_ENTRY = np.dtype([("item_plus_one", "<u4"), ("triangle", "<u4")])


class TriangleIds:
    """Table of a frame's triangle IDs: first of items drawn one by one, then of clusters.

    Args:
        context: where.
        draw_items: all of the scene.
        one_by_one: (n,) into `draw_items`.

    Attributes:
        first_of_item: ID of the first triangle of each item that is drawn one by one.
        texture: two integers an ID: 1 + number of the draw item, and number of its triangle.
    """

    def __init__(
        self,
        context: moderngl.Context,
        draw_items: Sequence[DrawItem],
        one_by_one: NDArray[np.intp],
    ):
        self._context = context
        entries = [_entries(draw_items[index], index) for index in one_by_one.tolist()]
        counts = np.array([len(part) for part in entries], dtype=np.int64)
        firsts = np.cumsum(counts) - counts
        self.first_of_item = dict(zip(one_by_one.tolist(), firsts.tolist(), strict=True))
        self._fixed = np.concatenate([np.empty(0, dtype=_ENTRY), *entries])
        self._fixed_rows = -(-len(self._fixed) // _ROW)
        self._appended: list[NDArray[np.void]] = []
        self.texture = self._allocate(max(1, self._fixed_rows))

    def begin(self) -> None:
        """Begin a frame."""
        self._appended = []

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
    contained = np.flatnonzero(geometry.contains).tolist()
    entries = np.concatenate([_entries(draw_items[index], index) for index in contained])
    ordered: NDArray[np.void] = entries[geometry.hierarchy.order]
    return ordered


def _entries(item: DrawItem, index: int) -> NDArray[np.void]:
    entries = np.empty(item.triangles, dtype=_ENTRY)
    entries["item_plus_one"], entries["triangle"] = index + 1, np.arange(item.triangles)
    return entries
