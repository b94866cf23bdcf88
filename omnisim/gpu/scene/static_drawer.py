"""Draws the static geometry into tiles: visible clusters, batch by batch, near ones first."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from typing import NamedTuple, Protocol

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.gpu.atlas.tile_plan import TilePlan
from omnisim.gpu.atlas.tile_views import TileView
from omnisim.gpu.culling.cluster_culling import ClusterCuller, VisibleClusters
from omnisim.gpu.scene.static_geometry import StaticGeometry
from omnisim.gpu.uniforms import columns_first
from omnisim.scene.model import Material

# Clusters are drawn batch by batch, which are few calls, but not near ones first, which spares
# occluded ones from being shaded. So those of the first pass, nearly all that is shaded, are drawn
# in bands of distance, batch by batch in each: a band ends where distances have doubled so often.
# No other pass changes the order of two clusters: of two surfaces with the same depth the same one
# is seen, whether occluded ones are left out or not.
BANDS, DOUBLINGS, NEAREST_M = 16, 1.5, 0.25
_STEPS = 1 << 12  # of distance in a band
_MAX_CLUSTERS = 1 << 23  # see `static_geometry.MAX_TRIANGLES`
_INDEX_BYTES = 12  # of a triangle


class ClusterDrawer(Protocol):
    """Draws clusters of the static geometry, by programs of its own."""

    def load(self, clusters: NDArray[np.intp]) -> None:
        """Put the triangles of clusters (n,) into a buffer, in this order."""

    def begin_tile(
        self,
        clip_from_anchor: NDArray[np.float32],
        viewpoint_from_anchor: NDArray[np.float32],
    ) -> None:
        """Draw by these matrices (4, 4), columns first, from now on."""

    def draw(self, batch: int, first: int, count: int) -> None:
        """Draw some of the loaded indices, which are of one material batch."""


class ClusterIndices:
    """Index buffer of clusters, and the vertex arrays by which programs draw from it.

    Args:
        geometry: the clusters'.
        programs: all that draw.
    """

    def __init__(self, geometry: StaticGeometry, programs: Collection[moderngl.Program]):
        self._geometry, self._programs = geometry, frozenset(programs)
        self._reserve(_INDEX_BYTES * len(geometry.triangles))

    def load(self, clusters: NDArray[np.intp]) -> None:
        """Put the triangles of clusters (n,) into the buffer, in this order."""
        # clipping, which never happens, is quicker than to look whether one is out of range
        triangles = self._geometry.triangles_of(clusters)
        indices = np.take(self._geometry.triangles, triangles, mode="clip")
        if indices.nbytes > self._indices.size:
            self._reserve(2 * indices.nbytes)
        self._indices.write(indices)

    def render(self, program: moderngl.Program, first: int, count: int) -> None:
        """Draw some of the indices."""
        self._vertex_arrays[program].render(moderngl.TRIANGLES, vertices=count, first=first)

    def _reserve(self, size: int) -> None:
        geometry = self._geometry
        self._indices = geometry.context.buffer(reserve=size, dynamic=True)
        self._vertex_arrays = {
            program: geometry.vertex_array(program, self._indices) for program in self._programs
        }


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
    """Draws static geometry for one camera; everything on the GPU is made once.

    Args:
        geometry: the clusters; others may draw from it, too.
        plan: the tiles.
        samples: of a texel.

    Attributes:
        triangles: submitted for the last frame.
    """

    def __init__(self, geometry: StaticGeometry, plan: TilePlan, samples: int):
        self._geometry = geometry
        double_sided = np.array([batch.material.double_sided for batch in geometry.batches])
        self._culler = ClusterCuller(
            geometry.hierarchy,
            double_sided[geometry.batch_of_cluster],
            geometry.anchor_m,
            plan,
            samples,
        )
        self.triangles = 0

    def passes(
        self,
        views: Sequence[TileView],
        viewpoint_m: NDArray[np.float64],
        drawer: ClusterDrawer,
        read_depth: Callable[[], NDArray[np.float32]],
    ) -> Iterator[list[TileCalls]]:
        """Draw calls of each tile, pass by pass, each to be drawn before the next.

        Args:
            views: of the tiles.
            viewpoint_m: (3,), world.
            drawer: loads the clusters.
            read_depth: reads the depth (height, width) of all that was drawn.
        """
        viewpoint_from_anchor = np.eye(4)
        viewpoint_from_anchor[:3, 3] = self._geometry.anchor_m - viewpoint_m
        clips = np.stack([view.clip_from_viewpoint for view in views]) @ viewpoint_from_anchor
        viewpoint_matrix = columns_first(viewpoint_from_anchor)
        self.triangles = 0
        for visible in self._culler.passes(views, viewpoint_m, read_depth):
            tiles = [TileCalls(clip, viewpoint_matrix, []) for clip in columns_first(clips)]
            if visible.node.size:
                drawer.load(self._schedule(visible, tiles))
            yield tiles

    def draw(self, tile: TileCalls, drawer: ClusterDrawer) -> None:
        """Draw the calls of a tile."""
        context = self._geometry.context
        context.front_face = "cw"
        drawer.begin_tile(tile.clip_from_anchor, tile.viewpoint_from_anchor)
        for batch, first, count in tile.calls:
            cull_back_faces(context, self._geometry.batches[batch].material)
            drawer.draw(batch, first, count)

    def _schedule(self, visible: VisibleClusters, tiles: list[TileCalls]) -> NDArray[np.intp]:
        """Sort clusters into draw calls, and append these to their tiles.

        Returns:
            The clusters (n,) in the order of the calls.
        """
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
        firsts = np.concatenate(([0], ends))[starts]
        counts = np.diff(firsts, append=ends[-1])
        for number, *call in zip(
            view[starts].tolist(), batch[starts].tolist(), firsts.tolist(), counts.tolist(),
            strict=True,
        ):  # fmt: skip
            tiles[number].calls.append((call[0], call[1], call[2]))
        self.triangles += int(ends[-1]) // 3
        return clusters


def cull_back_faces(context: moderngl.Context, material: Material) -> None:
    """Cull back faces, unless a material is double-sided."""
    toggle = context.disable if material.double_sided else context.enable
    toggle(moderngl.CULL_FACE)
