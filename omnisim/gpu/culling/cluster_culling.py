"""Culling of clusters for the views of a camera: hierarchy, normal cones, frusta, occlusion.

Where there is much to draw it is drawn in passes, wide and near clusters first: what these occlude
is left out of the passes that follow. A group that waits for a later pass is not opened before it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import count
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.gpu.atlas.tile_plan import TilePlan
from omnisim.gpu.atlas.tile_views import TileView
from omnisim.gpu.culling.clusters import ClusterGroups, ClusterHierarchy, Clusters, ranges
from omnisim.gpu.culling.frustum_culling import (
    EDGE_PX,
    FrustumCuller,
    ProjectedBoxes,
    ScreenBounds,
)
from omnisim.gpu.culling.hi_z import HiZ

# Clusters whose triangles look wider than the first of these occlude others, and are drawn first;
# then those that look wider than the next.
OCCLUDERS_RAD = (0.025, 0.007)
# Triangles that have to be left for each occlusion pass: to test them takes as long as to draw some
# of them, and keeps the GPU waiting.
MIN_TRIANGLES_PER_PASS = (80_000, 200_000)
_TOLERANCE = 1e-5  # cones are kept as float32: what is this close to a limit is drawn


class VisibleClusters(NamedTuple):
    """Clusters, or groups on the way to them, and the views that may see them, each (n,).

    Attributes:
        view, node: which.
        pass_index: to draw them in.
        far_m: largest distance.
        bounds: on the screen; None where depth is not tested.
    """

    view: NDArray[np.intp]
    node: NDArray[np.intp]
    pass_index: NDArray[np.int8]
    far_m: NDArray[np.float32]
    bounds: ScreenBounds | None

    def where(self, chosen: NDArray[np.bool_]) -> VisibleClusters:
        """Chosen ones (n,)."""
        kept = np.flatnonzero(chosen)
        bounds = None if self.bounds is None else self.bounds.take(kept)
        return VisibleClusters(
            self.view[kept], self.node[kept], self.pass_index[kept], self.far_m[kept], bounds
        )


class _Candidates(NamedTuple):
    """Nodes of one level (n,) in the frusta of views."""

    view: NDArray[np.intp]
    node: NDArray[np.intp]
    pass_index: NDArray[np.int8]
    distances_m: NDArray[np.float32]
    radii_m: NDArray[np.float32]
    boxes: ProjectedBoxes


class _Frame(NamedTuple):
    """Views of one frame; and where the hierarchy's origin is (3, 1), in the viewpoint frame."""

    frusta: FrustumCuller
    origin_m: NDArray[np.float64]


class ClusterCuller:
    """Culls the clusters of a hierarchy for one camera, pass by pass.

    Args:
        hierarchy: the clusters.
        double_sided: (n,), of the clusters: their back faces are seen, too.
        origin_m: (3,) of the hierarchy's positions, world.
        plan: the tiles.
        samples: of a texel. Depth of several cannot be read: then nothing is tested for occlusion.
    """

    def __init__(
        self,
        hierarchy: ClusterHierarchy,
        double_sided: NDArray[np.bool_],
        origin_m: NDArray[np.float64],
        plan: TilePlan,
        samples: int,
    ):
        self._groups = hierarchy.cluster_groups
        self._levels: tuple[Clusters | ClusterGroups, ...] = (hierarchy.clusters, *self._groups)
        self._cone_axes, sines = hierarchy.clusters.cone_axes, hierarchy.clusters.cone_sines
        self._cone_sines = np.where(double_sided, np.float32(2.0), sines)
        self._origin_m = origin_m
        self._reads_depth = samples <= 1
        self._radius_px = EDGE_PX if samples <= 1 else 0.5 + EDGE_PX
        self._hi_z = HiZ(plan.width_px, plan.height_px)
        roots = np.arange(len(self._levels[-1].first))
        view = np.repeat(np.arange(len(plan.tiles)), len(roots))
        self._roots = view, np.tile(roots, len(plan.tiles)), np.zeros(len(view), dtype=np.int8)

    def passes(
        self,
        views: Sequence[TileView],
        viewpoint_m: NDArray[np.float64],
        read_depth: Callable[[], NDArray[np.float32]],
    ) -> Iterator[VisibleClusters]:
        """Visible clusters of one frame, pass by pass, each to be drawn before the next.

        Args:
            views: of the tiles.
            viewpoint_m: (3,), world.
            read_depth: reads the depth (height, width) of all that was drawn.
        """
        frame = _Frame(
            FrustumCuller(views, self._radius_px), (self._origin_m - viewpoint_m)[:, None]
        )
        top = len(self._levels) - 1
        candidates = self._cull(frame, top, *self._roots)
        left = int(self._levels[top].triangles[candidates.node].sum())
        is_last = not self._is_worthwhile(0, left)
        roots = self._schedule(frame, top, candidates, 0, is_last)
        waiting = [*([] for _ in range(top)), [roots]]
        for pass_index in count():
            visible, waiting = self._descend(frame, waiting, pass_index, is_last)
            yield visible
            if is_last:
                return
            self._hi_z.update(read_depth())
            waiting = [[self._cull_occluded(one) for one in level] for level in waiting]
            left = sum(
                int(level.triangles[one.node].sum())
                for level, nodes in zip(self._levels, waiting, strict=True)
                for one in nodes
            )
            is_last = not self._is_worthwhile(pass_index + 1, left)

    def _is_worthwhile(self, pass_index: int, triangles: int) -> bool:
        """Test of a number of triangles, still to be drawn, against the cost of one more pass."""
        limits = MIN_TRIANGLES_PER_PASS if self._reads_depth else ()
        return pass_index < len(limits) and triangles >= limits[pass_index]

    def _descend(
        self,
        frame: _Frame,
        waiting: list[list[VisibleClusters]],
        pass_index: int,
        is_last: bool,
    ) -> tuple[VisibleClusters, list[list[VisibleClusters]]]:
        """Open the groups of this pass, level by level; the last pass opens all.

        Args:
            frame: to draw.
            waiting: of each level, from the pass before.
            pass_index: of this pass.
            is_last: no other pass follows.

        Returns:
            The clusters of this pass, and what waits.
        """
        opened: list[VisibleClusters] = []
        left: list[list[VisibleClusters]] = [[] for _ in waiting]
        for level in reversed(range(len(waiting))):
            visible = _concatenate(waiting[level] + opened)
            if not is_last:
                now = visible.pass_index <= pass_index
                left[level], visible = [visible.where(~now)], visible.where(now)
            if level == 0:
                break
            groups = self._groups[level - 1]
            first, children = groups.first[visible.node], groups.children[visible.node]
            view = np.repeat(visible.view, children)
            of_pass = np.repeat(visible.pass_index, children)
            candidates = self._cull(frame, level - 1, view, ranges(first, children), of_pass)
            found = self._schedule(frame, level - 1, candidates, pass_index, is_last)
            opened = [self._cull_occluded(found) if pass_index else found]
        return visible, left

    def _cull_occluded(self, nodes: VisibleClusters) -> VisibleClusters:
        return nodes if nodes.bounds is None else nodes.where(~self._hi_z.occludes(nodes.bounds))

    def _cull(
        self,
        frame: _Frame,
        level: int,
        view: NDArray[np.intp],
        node: NDArray[np.intp],
        pass_index: NDArray[np.int8],
    ) -> _Candidates:
        """Cull nodes (n,) of a level that the views do not see, whatever is in front of them."""
        nodes = self._levels[level]
        low_m, high_m = (
            (np.take(ends, node, axis=0).T + frame.origin_m).astype(np.float32, order="C")
            for ends in (nodes.aabb_min, nodes.aabb_max)
        )
        centres_m, half_extents_m = 0.5 * (low_m + high_m), 0.5 * (high_m - low_m)
        distances_m, radii_m = _norms(centres_m), _norms(half_extents_m)
        if level == 0:
            kept = np.flatnonzero(~self._faces_away(node, centres_m, distances_m, radii_m))
            view, node, pass_index = view[kept], node[kept], pass_index[kept]
            centres_m, half_extents_m = (
                np.take(part, kept, axis=1) for part in (centres_m, half_extents_m)
            )
            distances_m, radii_m = distances_m[kept], radii_m[kept]
        kept, boxes = frame.frusta.cull(view, centres_m, half_extents_m)
        return _Candidates(
            view[kept], node[kept], pass_index[kept], distances_m[kept], radii_m[kept], boxes
        )

    def _schedule(
        self, frame: _Frame, level: int, candidates: _Candidates, pass_index: int, is_last: bool
    ) -> VisibleClusters:
        """Bound nodes on the screen where depth is tested, and find their passes."""
        view, node, of_pass, distances_m, radii_m, boxes = candidates
        bounds = None
        if pass_index or not is_last:
            kept, bounds = frame.frusta.screen_bounds(boxes)
            view, node, of_pass = view[kept], node[kept], of_pass[kept]
            distances_m, radii_m = distances_m[kept], radii_m[kept]
        if not is_last:
            near_m = np.maximum(distances_m - radii_m, 1e-3)
            widths_m = self._levels[level].widths[node]
            own = sum(widths_m <= limit * near_m for limit in map(np.float32, OCCLUDERS_RAD))
            of_pass = np.maximum(of_pass, own).astype(np.int8)
        return VisibleClusters(view, node, of_pass, distances_m + radii_m, bounds)

    def _faces_away(
        self,
        clusters: NDArray[np.intp],
        centres_m: NDArray[np.float32],
        distances_m: NDArray[np.float32],
        radii_m: NDArray[np.float32],
    ) -> NDArray[np.bool_]:
        """Cone test (n,): clusters that show the viewpoint nothing but back faces.

        A normal is within the cone, and the direction to a triangle within the radius of the
        direction to the cluster's centre.
        """
        along_m = np.einsum("nc,cn->n", self._cone_axes[clusters], centres_m)
        sines = self._cone_sines[clusters] + np.float32(_TOLERANCE)
        away: NDArray[np.bool_] = along_m > sines * distances_m + radii_m
        return away


def _concatenate(parts: list[VisibleClusters]) -> VisibleClusters:
    """One or two sets of nodes as one."""
    if len(parts) == 1:
        return parts[0]
    one, other = parts
    bounds = None
    if one.bounds is not None and other.bounds is not None:
        bounds = ScreenBounds(
            *(np.concatenate(pair, axis=-1) for pair in zip(one.bounds, other.bounds, strict=True))
        )
    return VisibleClusters(
        np.concatenate((one.view, other.view)),
        np.concatenate((one.node, other.node)),
        np.concatenate((one.pass_index, other.pass_index)),
        np.concatenate((one.far_m, other.far_m)),
        bounds,
    )


def _norms(vectors: NDArray[np.float32]) -> NDArray[np.float32]:
    """Norms (n,) of vectors (3, n)."""
    x, y, z = vectors
    lengths: NDArray[np.float32] = np.sqrt(x * x + y * y + z * z)
    return lengths
