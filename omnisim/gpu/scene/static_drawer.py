"""Draws what stands still into the faces: of each face the chunks that it sees, near ones first."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.gpu.atlas.tile_plan import TilePlan
from omnisim.gpu.culling.cluster_culling import ClusterCuller, VisibleClusters
from omnisim.gpu.scene.static_geometry import StaticGeometry
from omnisim.gpu.scene.surface_program import SurfacePrograms, variant_of
from omnisim.gpu.scene.tile_drawer import TileView
from omnisim.gpu.uniforms import columns_first

# Clusters are drawn look by look, which are few calls, but not near ones first, which spares what
# is hidden from being shaded. So those of the first turn, nearly all that is shaded, are drawn in
# bands of distance, look by look in each: a band ends where distances have doubled so often. What
# else is drawn does not change the order of two chunks: of two surfaces with the same depth the
# same one is seen, whether what is hidden is left out or not.
BANDS, DOUBLINGS, NEAREST_M = 16, 1.5, 0.25
_STEPS = 1 << 12  # of distance in a band
_CHUNKS = 1 << 23  # at most, see `static_geometry.MOST_TRIANGLES`
_INDEX_BYTES = 12  # of a triangle
_NORMAL_FROM_ANCHOR = columns_first(np.eye(3))


class StaticDrawer:
    """Draws static geometry for one camera; everything on the GPU is made once.

    Args:
        context: where.
        geometry: what stands still; others may draw from it, too.
        surfaces: programs.
        plan: the faces.
        unlit: show plain base colours.
        samples: of a texel.

    Attributes:
        programs: that it draws with; whoever draws tells them where the viewpoint is.
        triangles: submitted for the last frame.
    """

    def __init__(
        self,
        context: moderngl.Context,
        geometry: StaticGeometry,
        surfaces: SurfacePrograms,
        plan: TilePlan,
        unlit: bool,
        samples: int = 1,
    ):
        self._context, self._geometry = context, geometry
        self._culling = ClusterCuller(geometry, plan, samples)
        variants = [variant_of(look.material, unlit, look.shading) for look in geometry.looks]
        self._programs = [surfaces[variant] for variant in variants]
        self.programs = frozenset(self._programs)
        self._make_room(_INDEX_BYTES * int(geometry.chunks.count.sum()))
        self._calls: list[list[tuple[int, int, int]]] = []
        self.triangles = 0

    def prepare(self, views: Sequence[TileView], viewpoint_m: NDArray[np.float64]) -> None:
        """Find what each view may see, and what of that to draw first.

        Args:
            views: the faces.
            viewpoint_m: (3,), world.
        """
        viewpoint_from_anchor = np.eye(4)
        viewpoint_from_anchor[:3, 3] = self._geometry.anchor_m - viewpoint_m
        self._viewpoint_from_anchor = columns_first(viewpoint_from_anchor)
        clips = np.stack([view.clip_from_viewpoint for view in views]) @ viewpoint_from_anchor
        self._clip_matrices = columns_first(clips)
        self.triangles = 0
        self._plan(self._culling.begin(views, viewpoint_m))

    @property
    def has_more(self) -> bool:
        """Whether something is left to draw that may be hidden."""
        return self._culling.has_more

    def prepare_more(self, read_depth: Callable[[], NDArray[np.float32]]) -> None:
        """Find what to draw next.

        Args:
            read_depth: gives the depth (height, width) of all that was drawn.
        """
        self._plan(self._culling.go_on(read_depth))

    def draw(self, number: int) -> None:
        """DrawItem what a view sees."""
        context, geometry = self._context, self._geometry
        context.front_face = "cw"
        placed, last = set(), -1
        for look, first, count in self._calls[number]:
            program, material = self._programs[look], geometry.looks[look].material
            if program not in placed:
                placed.add(program)
                program.set_matrices(
                    self._clip_matrices[number], self._viewpoint_from_anchor, _NORMAL_FROM_ANCHOR
                )
            if look != last:
                program.bind_material(material, geometry.looks[look].texture)
                toggle = context.disable if material.double_sided else context.enable
                toggle(moderngl.CULL_FACE)
                last = look
            self._vertex_arrays[program].render(moderngl.TRIANGLES, vertices=count, first=first)

    def _plan(self, draws: VisibleClusters) -> None:
        """Put draws into an order, and those of one call beside each other."""
        self._calls = [[] for _ in range(len(self._clip_matrices))]
        if not draws.number.size:
            return
        geometry = self._geometry
        looks = geometry.look_of_chunk[draws.number]
        distances = np.maximum(np.log2(draws.far_m / NEAREST_M), 0.0) / DOUBLINGS
        distances = np.minimum(np.where(draws.turn == 0, distances, 0.0), BANDS - 1e-3)
        bands = distances.astype(np.int64)
        calls = draws.view * BANDS + bands
        calls = calls * len(geometry.looks) + looks
        # one number for the call, the distance and the chunk: far quicker to sort than three
        steps = (_STEPS * (distances - bands)).astype(np.int64)
        order = np.argsort((calls * _STEPS + steps) * _CHUNKS + draws.number)
        calls, numbers = calls[order], draws.number[order]
        begins = np.flatnonzero(np.diff(calls, prepend=-1))
        # of each call, in indices
        ends = 3 * np.cumsum(geometry.chunks.count[numbers])
        firsts = np.concatenate(([0], ends))[begins]
        counts = np.diff(firsts, append=ends[-1])
        chosen = order[begins]
        for view, *call in zip(
            draws.view[chosen].tolist(), looks[chosen].tolist(), firsts.tolist(), counts.tolist(),
            strict=True,
        ):  # fmt: skip
            self._calls[view].append(tuple(call))
        indices = geometry.indices(numbers)
        self.triangles += len(indices)
        if indices.nbytes > self._indices.size:
            self._make_room(2 * indices.nbytes)
        self._indices.write(indices)

    def _make_room(self, size: int) -> None:
        """Have a buffer for so many bytes of indices."""
        self._indices = self._context.buffer(reserve=max(size, _INDEX_BYTES), dynamic=True)
        self._vertex_arrays = {
            program: self._geometry.vertex_array(program.program, self._indices)
            for program in self.programs
        }
