"""Finds what views may see of static geometry: group by group, then chunk by chunk.

Where there is much to see it is drawn in turns, what is wide and near first: what is hidden behind
that is left out of the turns that follow. A piece that has to wait is not opened before its turn.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.gpu.atlas.tile_plan import TilePlan
from omnisim.gpu.culling.clusters import Clusters, Groups, ranges
from omnisim.gpu.culling.frustum_culling import EDGE_PX, FrustumCuller, ScreenBounds
from omnisim.gpu.culling.hi_z import HiZ
from omnisim.gpu.scene.static_geometry import StaticGeometry
from omnisim.gpu.scene.tile_drawer import TileView

# Clusters whose triangles look wider than the first of these hide others, and are drawn first; then
# those that look wider than the next.
OCCLUDERS_RAD = (0.025, 0.007)
# For each of these turns, how many triangles have to be left: to find out which are hidden takes as
# long as to draw some of them, and keeps what draws waiting.
WORTH_A_TURN = (80_000, 200_000)
_SPARE = 1e-5  # cones are kept as float32: what is this close to a limit is drawn


class VisibleClusters(NamedTuple):
    """Pieces, chunks or groups, and the views to draw them in, each (n,).

    Attributes:
        view, number: which.
        turn: to draw them in, from 0, if there are so many.
        far_m: distance at most.
        outlines: what they cover; None where nothing is tested against depth.
    """

    view: NDArray[np.intp]
    number: NDArray[np.intp]
    turn: NDArray[np.int8]
    far_m: NDArray[np.float32]
    outlines: ScreenBounds | None

    def where(self, chosen: NDArray[np.bool_]) -> VisibleClusters:
        """Those that are chosen (n,)."""
        kept = np.flatnonzero(chosen)
        outlines = None if self.outlines is None else self.outlines.where(kept)
        return VisibleClusters(*(part[kept] for part in self[:-1]), outlines)


class ClusterCuller:
    """What the views of one camera may see of static geometry, turn by turn.

    Args:
        geometry: what stands still.
        plan: the faces.
        samples: of a texel. The depth of more than one cannot be read: then nothing is left out
            because it is hidden.

    Attributes:
        has_more: whether something waits for another turn.
    """

    def __init__(self, geometry: StaticGeometry, plan: TilePlan, samples: int):
        self._geometry = geometry
        self._depth = HiZ(plan.width_px, plan.height_px) if samples <= 1 else None
        self._reach_px = EDGE_PX if samples <= 1 else 0.5 + EDGE_PX
        self._levels: tuple[Clusters | Groups, ...] = (geometry.chunks, *geometry.groups)
        double_sided = np.array([look.material.double_sided for look in geometry.looks], dtype=bool)
        self._spreads = np.where(
            double_sided[geometry.look_of_chunk], np.float32(2.0), geometry.chunks.spreads
        )
        # of the largest groups, in all views
        number = np.arange(len(geometry.groups[-1].first))
        view = np.repeat(np.arange(len(plan.tiles)), len(number))
        number, turn = np.tile(number, len(plan.tiles)), np.zeros(len(view), dtype=np.int8)
        self._everything = view, number, turn
        self.has_more = False

    def begin(self, views: Sequence[TileView], viewpoint_m: NDArray[np.float64]) -> VisibleClusters:
        """Clusters to draw first.

        Args:
            views: the faces.
            viewpoint_m: (3,), world.
        """
        self._sight = FrustumCuller(views, self._reach_px)
        self._offset_m = (self._geometry.anchor_m - viewpoint_m)[:, None]
        self._turn = 0
        # what waits, by level
        self._waiting: list[VisibleClusters | None] = [None] * len(self._levels)
        self._waiting[-1] = self._seen(len(self._levels) - 1, *self._everything)
        return self._next()

    def go_on(self, read_depth: Callable[[], NDArray[np.float32]]) -> VisibleClusters:
        """Clusters to draw next.

        Args:
            read_depth: gives the depth (height, width) of all that was drawn.
        """
        self._depth.update(read_depth())
        self._turn += 1
        self._waiting = [draws and self._shown(draws) for draws in self._waiting]
        self.has_more = self._is_worth(self._left())
        return self._next()

    def _is_worth(self, left: int) -> bool:
        """Whether what is left is too much for one turn."""
        turns = 0 if self._depth is None else len(WORTH_A_TURN)
        return self._turn < turns and left >= WORTH_A_TURN[self._turn]

    def _left(self) -> int:
        """Triangles that wait."""
        return sum(
            int((level.count if number == 0 else level.triangles)[draws.number].sum())
            for number, (level, draws) in enumerate(zip(self._levels, self._waiting, strict=True))
            if draws is not None
        )

    def _next(self) -> VisibleClusters:
        """Clusters of this turn, and of all others if it is the last; what is left waits."""
        found = None
        for level in reversed(range(len(self._levels))):
            draws = _together(self._waiting[level], found)
            self._waiting[level] = None
            if self.has_more:
                now = draws.turn <= self._turn
                self._waiting[level], draws = draws.where(~now), draws.where(now)
            if level:
                first, count = (part[draws.number] for part in self._levels[level][:2])
                view, turn = np.repeat(draws.view, count), np.repeat(draws.turn, count)
                found = self._seen(level - 1, view, ranges(first, count), turn)
                if self._turn:
                    found = self._shown(found)
        return draws

    def _shown(self, draws: VisibleClusters) -> VisibleClusters:
        """Those that are not hidden."""
        return draws.where(~self._depth.hides(draws.outlines))

    def _seen(
        self,
        level: int,
        view: NDArray[np.intp],
        number: NDArray[np.intp],
        turn: NDArray[np.int8],
    ) -> VisibleClusters:
        """Which of some pieces (n,) of a level the views may see, in their turn or a later one."""
        pieces = self._levels[level]
        lows_m, highs_m = (
            (np.take(ends, number, axis=0).T + self._offset_m).astype(np.float32, order="C")
            for ends in (pieces.lows, pieces.highs)
        )
        middles_m, halves_m = 0.5 * (lows_m + highs_m), 0.5 * (highs_m - lows_m)
        distances_m, radii_m = _lengths(middles_m), _lengths(halves_m)
        if level == 0:
            kept = np.flatnonzero(~self._turned_away(number, middles_m, distances_m, radii_m))
            view, number, turn = view[kept], number[kept], turn[kept]
            middles_m, halves_m = (np.take(part, kept, axis=1) for part in (middles_m, halves_m))
            distances_m, radii_m = distances_m[kept], radii_m[kept]
        seen, boxes = self._sight.in_view(view, middles_m, halves_m)
        if pieces is self._levels[-1]:
            self.has_more = self._is_worth(int(pieces.triangles[number[seen]].sum()))
        if self._turn or self.has_more:
            covering, outlines = self._sight.outlines(boxes)
            seen = seen[covering]
        else:
            outlines = None
        view, number, turn = view[seen], number[seen], turn[seen]
        distances_m, radii_m = distances_m[seen], radii_m[seen]
        if self.has_more:
            near_m, widths_m = np.maximum(distances_m - radii_m, 1e-3), pieces.widths[number]
            own_turn = sum(widths_m <= least * near_m for least in map(np.float32, OCCLUDERS_RAD))
            turn = np.maximum(turn, own_turn).astype(np.int8)
        return VisibleClusters(view, number, turn, distances_m + radii_m, outlines)

    def _turned_away(
        self,
        chunk: NDArray[np.intp],
        middles_m: NDArray[np.float32],
        distances_m: NDArray[np.float32],
        radii_m: NDArray[np.float32],
    ) -> NDArray[np.bool_]:
        """Which chunks (n,) show the viewpoint nothing but back sides, which nobody sees.

        A normal is within the spread of the axis, and the direction to a triangle within the radius
        of the direction to the chunk's middle.
        """
        along_m = np.einsum("nc,cn->n", self._geometry.chunks.axes[chunk], middles_m)
        return along_m > (self._spreads[chunk] + np.float32(_SPARE)) * distances_m + radii_m


def _together(one: VisibleClusters | None, other: VisibleClusters | None) -> VisibleClusters:
    """Both, one of which is there."""
    if one is None or other is None:
        return one or other
    parts = (np.concatenate(pair) for pair in zip(one[:-1], other[:-1], strict=True))
    outlines = (
        np.concatenate(pair, axis=-1) for pair in zip(one.outlines, other.outlines, strict=True)
    )
    return VisibleClusters(*parts, ScreenBounds(*outlines))


def _lengths(vectors: NDArray[np.floating]) -> NDArray[np.float32]:
    """Of vectors (3, n)."""
    x, y, z = vectors
    lengths: NDArray[np.float32] = np.sqrt(x * x + y * y + z * z)
    return lengths
