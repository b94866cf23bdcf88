"""Triangle IDs (visibility buffer), and the table that resolves them.

A fragment knows only its triangle's position within the draw call. All triangles are therefore
numbered in drawing order, first those of single items, then those of clusters. The atlas holds
these IDs; the table maps each to draw item and triangle.
Source: Burns & Hunt, "The visibility buffer", 2013.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Indices
from omnisim.rendering.opengl.gl.gpu_textures import texture_2d
from omnisim.rendering.opengl.world.clustered_geometry import ClusteredGeometry
from omnisim.rendering.opengl.world.draw_item import DrawItem
from omnisim.rendering.opengl.world.scene_buffers import SceneBuffers
from omnisim.rendering.opengl.world.triangle_table import ROW_BITS

_ROW = 1 << ROW_BITS
_ENTRY = np.dtype([("item_plus_one", "<u4"), ("triangle", "<u4")])


class TriangleIds:
    """Table of triangle IDs: first single items, then clusters.

    Args:
        one_by_one: (n,) items that are drawn one by one.

    Attributes:
        first_of_item: ID of the first triangle of each such item.
        first_of_clusters: ID of the first triangle of the clusters.
        texture: two integers per ID: 1 + draw item, and triangle in the item.
    """

    def __init__(self, buffers: SceneBuffers, one_by_one: Indices):
        self._context, self._buffers = buffers.context, buffers
        self.refresh(one_by_one)

    def refresh(self, one_by_one: Indices) -> None:
        """Renumber after the buffers changed; `one_by_one` are the items outside of clusters."""
        draw_items, geometry = self._buffers.draw_items, self._buffers.clustered_geometry
        items = one_by_one.tolist()
        counts = np.array([draw_items[item].triangles for item in items], dtype=np.int64)
        self.first_of_item = dict(zip(items, (np.cumsum(counts) - counts).tolist(), strict=True))
        entries = _entries(draw_items, items)
        self.first_of_clusters = len(entries)
        if geometry is not None:
            entries = np.concatenate((entries, cluster_triangle_entries(geometry, draw_items)))
        padded = np.zeros(max(1, -(-len(entries) // _ROW)) * _ROW, dtype=_ENTRY)
        padded[: len(entries)] = entries
        self.texture = texture_2d(self._context, (_ROW, len(padded) // _ROW), 2, padded, dtype="u4")


def cluster_triangle_entries(
    geometry: ClusteredGeometry, draw_items: Sequence[DrawItem]
) -> NDArray[np.void]:
    """Table entries (n,) of the clusters' triangles, in drawing order."""
    entries = _entries(draw_items, np.flatnonzero(geometry.contains).tolist())
    return entries[geometry.hierarchy.order]


def _entries(draw_items: Sequence[DrawItem], items: list[int]) -> NDArray[np.void]:
    """Table entries (n,) of the items' triangles."""
    counts = [draw_items[item].triangles for item in items]
    entries = np.empty(sum(counts), dtype=_ENTRY)
    entries["item_plus_one"] = np.repeat(np.array(items, dtype=np.intp) + 1, counts)
    entries["triangle"] = np.concatenate([np.empty(0, int), *map(np.arange, counts)])
    return entries
