"""Culling of clusters for the views of a camera: hierarchy, normal cones, frusta, occlusion.

Where there is much to draw it is drawn in passes, wide and near clusters first: what these occlude
is left out of the passes that follow. A group that waits for a later pass is not opened before it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.gpu.atlas.tile_plan import TilePlan
from omnisim.gpu.atlas.tile_views import TileView
from omnisim.gpu.culling.clusters import ClusterGroups, ClusterHierarchy, Clusters, ranges
from omnisim.gpu.culling.frustum_culling import (
    EDGE_PX,
    FrustumCuller,
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


class ClusterCuller:
    """Culls the clusters of a hierarchy for one camera, pass by pass.

    Args:
        hierarchy: the clusters.
        double_sided: (n,), of the clusters: their back faces are seen, too.
        origin_m: (3,) of the hierarchy's positions, world.
        plan: the tiles.
        samples: of a texel. Depth of several cannot be read: then nothing is tested for occlusion.

    Attributes:
        groups, levels: of the hierarchy; levels begin with the clusters.
        roots: view, node and pass of the largest groups, in all views.
        hi_z: depth of the passes before.
    """

    def __init__(
        self,
        hierarchy: ClusterHierarchy,
        double_sided: NDArray[np.bool_],
        origin_m: NDArray[np.float64],
        plan: TilePlan,
        samples: int,
    ):
        self.groups = hierarchy.cluster_groups
        self.levels: tuple[Clusters | ClusterGroups, ...] = (hierarchy.clusters, *self.groups)
        self._cone_axes, sines = hierarchy.clusters.cone_axes, hierarchy.clusters.cone_sines
        self._cone_sines = np.where(double_sided, np.float32(2.0), sines)
        self._origin_m = origin_m
        self._reads_depth = samples <= 1
        self._radius_px = EDGE_PX if samples <= 1 else 0.5 + EDGE_PX
        self.hi_z = HiZ(plan.width_px, plan.height_px)
        roots = np.arange(len(self.levels[-1].first))
        view = np.repeat(np.arange(len(plan.tiles)), len(roots))
        self.roots = view, np.tile(roots, len(plan.tiles)), np.zeros(len(view), dtype=np.int8)

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
        frusta = FrustumCuller(views, self._radius_px)
        descent = _Descent(self, frusta, (self._origin_m - viewpoint_m)[:, None])
        yield descent.open_groups()
        while not descent.is_last_pass:
            self.hi_z.update(read_depth())
            descent.begin_pass()
            yield descent.open_groups()

    def is_worthwhile(self, pass_index: int, triangles: int) -> bool:
        """Test a number of triangles, still to be drawn, against the cost of one more pass."""
        limits = MIN_TRIANGLES_PER_PASS if self._reads_depth else ()
        return pass_index < len(limits) and triangles >= limits[pass_index]

    def cull_occluded(self, nodes: VisibleClusters) -> VisibleClusters:
        """Cull nodes that are behind the depth of the passes before."""
        return nodes if nodes.bounds is None else nodes.where(~self.hi_z.occludes(nodes.bounds))

    def faces_away(
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


class _Descent:
    """One frame's descent from the largest groups to the clusters, pass by pass.

    Args:
        culler: of the camera.
        frusta: of the frame's views.
        origin_m: (3, 1) of the hierarchy, in the viewpoint frame.

    Attributes:
        is_last_pass: the current pass draws all that is left.
    """

    def __init__(self, culler: ClusterCuller, frusta: FrustumCuller, origin_m: NDArray[np.float64]):
        self._culler, self._frusta, self._origin_m = culler, frusta, origin_m
        self._pass_index, self.is_last_pass = 0, True
        self._waiting: list[list[VisibleClusters]] = [[] for _ in culler.levels]
        self._waiting[-1] = [self._visit(len(culler.levels) - 1, *culler.roots)]

    def begin_pass(self) -> None:
        """Begin the next pass: cull what waits by the depth so far."""
        culler = self._culler
        self._pass_index += 1
        self._waiting = [[culler.cull_occluded(one) for one in nodes] for nodes in self._waiting]
        triangles = sum(
            int(level.triangles[one.node].sum())
            for level, nodes in zip(culler.levels, self._waiting, strict=True)
            for one in nodes
        )
        self.is_last_pass = not culler.is_worthwhile(self._pass_index, triangles)

    def open_groups(self) -> VisibleClusters:
        """Open the groups of this pass, level by level, and return its clusters."""
        opened: list[VisibleClusters] = []
        for level in reversed(range(len(self._waiting))):
            visible = _concatenate(self._waiting[level] + opened)
            if not self.is_last_pass:
                is_due = visible.pass_index <= self._pass_index
                self._waiting[level] = [visible.where(~is_due)]
                visible = visible.where(is_due)
            if level == 0:
                break
            groups = self._culler.groups[level - 1]
            first, children = groups.first[visible.node], groups.children[visible.node]
            view = np.repeat(visible.view, children)
            of_pass = np.repeat(visible.pass_index, children)
            found = self._visit(level - 1, view, ranges(first, children), of_pass)
            opened = [self._culler.cull_occluded(found) if self._pass_index else found]
        return visible

    def _visit(
        self,
        level: int,
        view: NDArray[np.intp],
        node: NDArray[np.intp],
        pass_index: NDArray[np.int8],
    ) -> VisibleClusters:
        """Cull nodes (n,) of a level by cones and frusta, and find their passes."""
        nodes = self._culler.levels[level]
        low_m, high_m = (
            (np.take(ends, node, axis=0).T + self._origin_m).astype(np.float32, order="C")
            for ends in (nodes.aabb_min, nodes.aabb_max)
        )
        centres_m, half_extents_m = 0.5 * (low_m + high_m), 0.5 * (high_m - low_m)
        distances_m, radii_m = _norms(centres_m), _norms(half_extents_m)
        if level == 0:
            away = self._culler.faces_away(node, centres_m, distances_m, radii_m)
            kept = np.flatnonzero(~away)
            view, node, pass_index = view[kept], node[kept], pass_index[kept]
            centres_m, half_extents_m = (
                np.take(part, kept, axis=1) for part in (centres_m, half_extents_m)
            )
            distances_m, radii_m = distances_m[kept], radii_m[kept]
        kept, boxes = self._frusta.cull(view, centres_m, half_extents_m)
        if level == len(self._waiting) - 1:
            triangles = int(nodes.triangles[node[kept]].sum())
            self.is_last_pass = not self._culler.is_worthwhile(0, triangles)
        bounds = None
        if self._pass_index or not self.is_last_pass:
            covering, bounds = self._frusta.screen_bounds(boxes)
            kept = kept[covering]
        view, node, pass_index = view[kept], node[kept], pass_index[kept]
        distances_m, radii_m = distances_m[kept], radii_m[kept]
        if not self.is_last_pass:
            near_m, widths_m = np.maximum(distances_m - radii_m, 1e-3), nodes.widths[node]
            own = sum(widths_m <= limit * near_m for limit in map(np.float32, OCCLUDERS_RAD))
            pass_index = np.maximum(pass_index, own).astype(np.int8)
        return VisibleClusters(view, node, pass_index, distances_m + radii_m, bounds)


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
