"""Frustum culling of boxes against the tiles of an atlas, and their bounds on the screen.

Positions are in the viewpoint frame. Depth is reversed (`omnisim.gpu.scene.reversed_depth`):
larger is nearer, 0 is infinitely far.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.gpu.atlas.tile_views import TileView

# Boxes are projected as float32: each counts as larger by this share of its distance.
_TOLERANCE = 2e-6
# Where an edge lies, a GPU rounds to a sixteenth of a texel at worst.
EDGE_PX = 0.125


class ScreenBounds(NamedTuple):
    """Rectangles of the atlas that boxes cover.

    Attributes:
        first, last: (2, n) columns and rows, both covered.
        nearest: (n,) depth of the nearest corner; infinite where a box reaches the near plane.
    """

    first: NDArray[np.int32]
    last: NDArray[np.int32]
    nearest: NDArray[np.float32]

    def take(self, chosen: NDArray[np.intp]) -> ScreenBounds:
        """Bounds of some boxes, by number."""
        # far quicker than indices in brackets
        first, last = np.take(self.first, chosen, axis=1), np.take(self.last, chosen, axis=1)
        return ScreenBounds(first, last, self.nearest[chosen])


class ProjectedBoxes(NamedTuple):
    """Boxes in clip space: its first, second and fourth coordinate.

    Attributes:
        view: (n,) index.
        centres: (3, n).
        half_edges: (3, 3, n), the edges are the second index.
    """

    view: NDArray[np.intp]
    centres: NDArray[np.float32]
    half_edges: NDArray[np.float32]


class FrustumCuller:
    """Frusta of the tiles' views in one frame.

    Args:
        views: of the tiles.
        radius_px: distance from a texel's centre up to which it is covered: half a texel and more
            where it has several samples.
    """

    def __init__(self, views: Sequence[TileView], radius_px: float):
        clips = np.stack([view.clip_from_viewpoint for view in views])
        self._rows = clips[:, (0, 1, 3), :3].reshape(-1, 9).T.astype(np.float32, order="C")
        # depth is a + b / w, as the third row of the clip space runs along the fourth
        slopes = np.sum(clips[:, 2, :3] * clips[:, 3, :3], axis=1)
        nears = clips[:, 2, 3] / (1.0 - slopes)
        fars = [-shift / slope if slope < 0.0 else np.inf
                for slope, shift in zip(slopes, clips[:, 2, 3], strict=True)]  # fmt: skip
        tiles = np.array([(one.tile.left_px, one.tile.top_px, *one.tile.size_px) for one in views])
        self._views = np.stack((slopes, clips[:, 2, 3], nears, *tiles.T)).astype(np.float32)
        self._fars = np.array(fars, dtype=np.float32)
        self._radius_px = radius_px

    def cull(
        self,
        view: NDArray[np.intp],
        centres_m: NDArray[np.float32],
        half_extents_m: NDArray[np.float32],
    ) -> tuple[NDArray[np.intp], ProjectedBoxes]:
        """Cull boxes of which all is behind one of a frustum's six planes.

        Args:
            view: (n,) index.
            centres_m, half_extents_m: (3, n).

        Returns:
            Numbers (m,) of those that are left, and their projections for `screen_bounds`.
        """
        half_extents_m = half_extents_m + _TOLERANCE * (
            _sum_of_magnitudes(centres_m) + _sum_of_magnitudes(half_extents_m)
        )
        rows = np.take(self._rows, view, axis=1).reshape(3, 3, -1)
        x, y, w = (row[0] * centres_m[0] + row[1] * centres_m[1] + row[2] * centres_m[2]
                   for row in rows)  # fmt: skip
        edges = rows * half_extents_m
        depths = _sum_of_magnitudes(edges[2])
        inside = w + depths >= self._views[2][view]
        inside &= w - depths <= self._fars[view]
        for centre, edge in ((x, edges[0]), (y, edges[1])):
            inside &= w + centre + _sum_of_magnitudes(edges[2] + edge) >= 0.0
            inside &= w - centre + _sum_of_magnitudes(edges[2] - edge) >= 0.0
        kept = np.flatnonzero(inside)
        centres, edges = np.take((x, y, w), kept, axis=1), np.take(edges, kept, axis=2)
        return kept, ProjectedBoxes(view[kept], centres, edges)

    def screen_bounds(self, boxes: ProjectedBoxes) -> tuple[NDArray[np.intp], ScreenBounds]:
        """Bounds of boxes on the screen.

        Returns:
            Numbers (m,) of those that cover a texel's centre, and their bounds.
        """
        view, centres, edges = boxes
        slope, shift, near, left, top, width, height = np.take(self._views, view, axis=1)
        x, y, w = (_corners(centre, edge) for centre, edge in zip(centres, edges, strict=True))
        crosses = w.min(axis=0) < near
        scale = np.float32(1.0) / np.maximum(w, near)
        nearest = slope + shift * scale.max(axis=0)
        nearest[crosses] = np.inf
        covers = np.ones(len(view), dtype=np.bool_)
        first, last = np.empty((2, 2, len(view)), dtype=np.int32)
        for axis, along, start, size in ((0, x, left, width), (1, y, top, height)):
            along *= scale  # −1 and 1 are the tile's edges
            # a texel is covered where its centre is, half a texel after its edge
            low = np.ceil(0.5 * size * (along.min(axis=0) + 1.0) - (0.5 + self._radius_px))
            high = np.floor(0.5 * size * (along.max(axis=0) + 1.0) - (0.5 - self._radius_px))
            low = np.where(crosses, 0.0, np.maximum(low, 0.0))
            high = np.where(crosses, size - 1.0, np.minimum(high, size - 1.0))
            covers &= low <= high
            first[axis], last[axis] = start + low, start + high
        kept = np.flatnonzero(covers)
        return kept, ScreenBounds(first, last, nearest).take(kept)


def _sum_of_magnitudes(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Sum (n,) of the magnitudes of coordinates (3, n): the reach of a box from its centre."""
    x, y, z = np.abs(values)
    x += y
    x += z
    total: NDArray[np.float32] = x
    return total


def _corners(centre: NDArray[np.float32], edges: NDArray[np.float32]) -> NDArray[np.float32]:
    """One coordinate (8, n) of the corners of boxes, by that of centres and half edges."""
    corners = np.empty((8, len(centre)), dtype=np.float32)
    np.subtract(centre, edges[0], out=corners[0])
    np.add(centre, edges[0], out=corners[4])
    np.add(corners[0::4], edges[1], out=corners[2::4])
    corners[0::4] -= edges[1]
    np.add(corners[0::2], edges[2], out=corners[1::2])
    corners[0::2] -= edges[2]
    return corners
