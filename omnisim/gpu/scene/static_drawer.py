"""Schedules the static geometry's visible clusters: batch by batch, near ones first."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.gpu.atlas.tile_plan import TilePlan
from omnisim.gpu.atlas.tile_views import TileView
from omnisim.gpu.culling.cluster_culling import ClusterCuller, VisibleClusters
from omnisim.gpu.scene.static_geometry import StaticGeometry
from omnisim.gpu.uniforms import columns_first

# Clusters are drawn batch by batch, which are few calls, but not near ones first, which spares
# occluded ones from being shaded. So those of the first pass, nearly all that is shaded, are drawn
# in bands of distance, batch by batch in each: a band ends where distances have doubled so often.
# No other pass changes the order of two clusters: of two surfaces with the same depth the same one
# is seen, whether occluded ones are left out or not.
BANDS, DOUBLINGS, NEAREST_M = 16, 1.5, 0.25
_STEPS = 1 << 12  # of distance in a band
_MAX_CLUSTERS = 1 << 23  # see `static_geometry.MAX_TRIANGLES`


class TileCalls(NamedTuple):
    """Draw calls of one tile in one pass.

    Attributes:
        clip_from_anchor, viewpoint_from_anchor: (4, 4), columns first.
        calls: batch, first index and number of indices, each.
    """

    clip_from_anchor: NDArray[np.float32]
    viewpoint_from_anchor: NDArray[np.float32]
    calls: list[tuple[int, int, int]]


class StaticDrawer:
    """Culls and schedules the static geometry for one camera.

    Args:
        geometry: the clusters.
        plan: the tiles.
        samples: of a texel.
        both_sides: all clusters are seen from behind, too.

    Attributes:
        triangles: submitted for the last frame.
    """

    def __init__(
        self, geometry: StaticGeometry, plan: TilePlan, samples: int, both_sides: bool = False
    ):
        self._geometry = geometry
        double_sided = np.array([batch.material.double_sided for batch in geometry.batches])
        double_sided = double_sided[geometry.batch_of_cluster] | both_sides
        anchor_m = geometry.anchor_m
        self._culler = ClusterCuller(geometry.hierarchy, double_sided, anchor_m, plan, samples)
        self.triangles = 0

    def passes(
        self,
        views: Sequence[TileView],
        viewpoint_m: NDArray[np.float64],
        load: Callable[[NDArray[np.intp]], None],
        read_depth: Callable[[], NDArray[np.float32]],
    ) -> Iterator[list[TileCalls]]:
        """Draw calls of each tile, pass by pass, each to be drawn before the next.

        Args:
            views: of the tiles.
            viewpoint_m: (3,), world.
            load: puts the triangles of clusters (n,) into an index buffer, in this order.
            read_depth: reads the depth (height, width) of all that was drawn.
        """
        viewpoint_from_anchor = np.eye(4)
        viewpoint_from_anchor[:3, 3] = self._geometry.anchor_m - viewpoint_m
        clips_from_viewpoint = np.stack([view.clip_from_viewpoint for view in views])
        clips = columns_first(clips_from_viewpoint @ viewpoint_from_anchor)
        viewpoint_matrix = columns_first(viewpoint_from_anchor)
        self.triangles = 0
        for visible in self._culler.passes(views, viewpoint_m, read_depth):
            tiles = [TileCalls(clip, viewpoint_matrix, []) for clip in clips]
            if visible.node.size:
                load(self._schedule(visible, tiles))
            yield tiles

    def _schedule(self, visible: VisibleClusters, tiles: list[TileCalls]) -> NDArray[np.intp]:
        """Append draw calls to the tiles; return their clusters (n,), in the order of the calls."""
        geometry = self._geometry
        batch = geometry.batch_of_cluster[visible.node]
        distances = np.maximum(np.log2(visible.far_m / NEAREST_M), 0.0) / DOUBLINGS
        distances = np.minimum(np.where(visible.pass_index == 0, distances, 0.0), BANDS - 1e-3)
        bands = distances.astype(np.int64)
        keys = (visible.view * BANDS + bands) * len(geometry.batches) + batch
        # one number for the call, the distance and the cluster: far quicker to sort than three
        steps = (_STEPS * (distances - bands)).astype(np.int64)
        order = np.argsort((keys * _STEPS + steps) * _MAX_CLUSTERS + visible.node)
        clusters, view, batch = visible.node[order], visible.view[order], batch[order]
        starts = np.flatnonzero(np.diff(view * len(geometry.batches) + batch, prepend=-1))
        ends = 3 * np.cumsum(geometry.clusters.triangles[clusters])  # in indices
        first = np.append(0, ends)[starts]
        count = np.diff(first, append=ends[-1])
        calls = zip(batch[starts].tolist(), first.tolist(), count.tolist(), strict=True)
        for tile, call in zip(view[starts].tolist(), calls, strict=True):
            tiles[tile].calls.append(call)
        self.triangles += int(ends[-1]) // 3
        return clusters
