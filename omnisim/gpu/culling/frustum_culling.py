"""What boxes cover of the tiles of an atlas, and which of them are in view at all.

Everything is counted from the viewpoint, in the world's axes. Depth is reversed
(`omnisim.gpu.scene.reversed_depth`): larger is nearer, 0 is infinitely far.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.gpu.scene.tile_drawer import TileView

# Boxes are projected as float32: each counts as larger by this share of its distance.
_SPARE = 2e-6
# Where an edge lies, a GPU rounds to a sixteenth of a texel at worst.
EDGE_PX = 0.125


class ScreenBounds(NamedTuple):
    """What boxes cover of the atlas.

    Attributes:
        first, last: (2, n) columns and rows, both covered.
        nearest: (n,) depth of the nearest corner; infinite where a box reaches the near plane.
    """

    first: NDArray[np.int32]
    last: NDArray[np.int32]
    nearest: NDArray[np.float32]

    def where(self, chosen: NDArray[np.intp]) -> ScreenBounds:
        """Some of them, by number."""
        # far quicker than indices in brackets
        first, last = np.take(self.first, chosen, axis=1), np.take(self.last, chosen, axis=1)
        return ScreenBounds(first, last, self.nearest[chosen])


class Projected(NamedTuple):
    """Boxes in view.

    Attributes:
        view: (n,) in which one.
        middles: (3, n) first, second and fourth clip coordinate of their middles.
        edges: (3, 3, n) these of half their edges, which are the second index.
    """

    view: NDArray[np.intp]
    middles: NDArray[np.float32]
    edges: NDArray[np.float32]


class FrustumCuller:
    """The views of one frame, ready to project many boxes.

    Args:
        views: the faces.
        reach_px: how far from a texel's middle it is still covered: half a texel and more where it
            has several samples.
    """

    def __init__(self, views: Sequence[TileView], reach_px: float):
        clips = np.stack([view.clip_from_viewpoint for view in views])
        self._rows = clips[:, (0, 1, 3), :3].reshape(-1, 9).T.astype(np.float32, order="C")
        # depth is a + b / w, as the third row of the clip space runs along the fourth
        across = np.sum(clips[:, 2, :3] * clips[:, 3, :3], axis=1)
        nears = clips[:, 2, 3] / (1.0 - across)
        fars = [-shift / one if one < 0.0 else np.inf
                for one, shift in zip(across, clips[:, 2, 3], strict=True)]  # fmt: skip
        faces = [view.tile for view in views]
        tiles = np.array([(tile.left_px, tile.top_px, *tile.size_px) for tile in faces])
        self._tiles = np.stack((across, clips[:, 2, 3], nears, *tiles.T)).astype(np.float32)
        self._fars = np.array(fars, dtype=np.float32)
        self._reach_px = reach_px

    def in_view(
        self,
        view: NDArray[np.intp],
        middles_m: NDArray[np.float32],
        halves_m: NDArray[np.float32],
    ) -> tuple[NDArray[np.intp], Projected]:
        """Which boxes may be in view: none of its six planes has all of one behind it.

        Args:
            view: (n,) in which one.
            middles_m, halves_m: (3, n).

        Returns:
            Those (m,) that are, and what `outlines` needs of them.
        """
        halves_m = halves_m + _SPARE * (_sum_of_sizes(middles_m) + _sum_of_sizes(halves_m))
        rows = np.take(self._rows, view, axis=1).reshape(3, 3, -1)
        middles = [row[0] * middles_m[0] + row[1] * middles_m[1] + row[2] * middles_m[2]
                   for row in rows]  # fmt: skip
        edges = rows * halves_m
        depths = _sum_of_sizes(edges[2])
        seen = middles[2] + depths >= self._tiles[2][view]
        seen &= middles[2] - depths <= self._fars[view]
        for middle, edge in zip(middles[:2], edges[:2], strict=True):
            seen &= middles[2] + middle + _sum_of_sizes(edges[2] + edge) >= 0.0
            seen &= middles[2] - middle + _sum_of_sizes(edges[2] - edge) >= 0.0
        kept = np.flatnonzero(seen)
        middles, edges = np.take(middles, kept, axis=1), np.take(edges, kept, axis=2)
        return kept, Projected(view[kept], middles, edges)

    def outlines(self, boxes: Projected) -> tuple[NDArray[np.intp], ScreenBounds]:
        """ScreenBounds of boxes in view.

        Returns:
            Those (m,) that cover a texel's middle, and what they cover.
        """
        view, middles, edges = boxes
        across, shift, near, left, top, width, height = np.take(self._tiles, view, axis=1)
        x, y, w = (_corners(middle, edge) for middle, edge in zip(middles, edges, strict=True))
        crosses = w.min(axis=0) < near
        scale = np.float32(1.0) / np.maximum(w, near)
        nearest = across + shift * scale.max(axis=0)
        nearest[crosses] = np.inf
        covers = np.ones(len(view), dtype=np.bool_)
        first, last = np.empty((2, 2, len(view)), dtype=np.int32)
        for axis, along, start, size in ((0, x, left, width), (1, y, top, height)):
            along *= scale  # −1 and 1 are the tile's edges
            # a texel is covered where its middle is, half a texel after its edge
            low = np.ceil(0.5 * size * (along.min(axis=0) + 1.0) - (0.5 + self._reach_px))
            high = np.floor(0.5 * size * (along.max(axis=0) + 1.0) - (0.5 - self._reach_px))
            low = np.where(crosses, 0.0, np.maximum(low, 0.0))
            high = np.where(crosses, size - 1.0, np.minimum(high, size - 1.0))
            covers &= low <= high
            first[axis], last[axis] = start + low, start + high
        kept = np.flatnonzero(covers)
        return kept, ScreenBounds(first, last, nearest).where(kept)


def _sum_of_sizes(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Of coordinates (3, n): how far halved edges of boxes lead from their middles at most."""
    one, two, three = np.abs(values)
    one += two
    one += three
    total: NDArray[np.float32] = one
    return total


def _corners(middle: NDArray[np.float32], edges: NDArray[np.float32]) -> NDArray[np.float32]:
    """One coordinate (8, n) of the corners of boxes, by that of their middles and halved edges."""
    corners = np.empty((8, len(middle)), dtype=np.float32)
    np.subtract(middle, edges[0], out=corners[0])
    np.add(middle, edges[0], out=corners[4])
    np.add(corners[0::4], edges[1], out=corners[2::4])
    corners[0::4] -= edges[1]
    np.add(corners[0::2], edges[2], out=corners[1::2])
    corners[0::2] -= edges[2]
    return corners
