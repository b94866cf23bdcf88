"""Draws what stands still into the faces: of each face the chunks that it sees, near ones first."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.gpu.face_drawing import FaceView
from omnisim.gpu.occlusion import CoarseDepth, outlines
from omnisim.gpu.standing_geometry import StandingGeometry
from omnisim.gpu.surface_program import SurfacePrograms, variant_of
from omnisim.gpu.uniforms import columns_first

# Chunks are drawn look by look, which are few calls, but not near ones first, which spares what is
# hidden from being shaded. So they are drawn in so many bands of distance, each look by look.
BANDS = 8
# Boxes and cones are kept as float32: what is this close to a limit is drawn.
_SPARE = 1e-5
# Chunks whose triangles look about so wide hide others, and are drawn first.
OCCLUDER_RAD = 0.01
# Fewer triangles than this are drawn in less time than one finds out whether they are hidden.
WORTH_A_TEST = 80_000
_INDEX_BYTES = 12  # of a triangle
_NORMAL_FROM_ANCHOR = columns_first(np.eye(3))


class _Draws(NamedTuple):
    """Chunks to draw, and the views to draw them in: (n,) each, by view."""

    view: NDArray[np.intp]
    chunk: NDArray[np.intp]

    def where(self, chosen: NDArray[np.bool_]) -> _Draws:
        return _Draws(self.view[chosen], self.chunk[chosen])


class StandingDrawing:
    """Draws standing geometry for one camera; everything on the GPU is made once.

    Args:
        context: where.
        geometry: what stands still; others may draw from it, too.
        surfaces: programs.
        unlit: show plain base colours.
        reads_depth: whether the depth of what was drawn can be read: otherwise nothing is left out
            because it is hidden.

    Attributes:
        programs: that it draws with; whoever draws tells them where the viewpoint is.
        triangles: submitted for the last frame.
    """

    def __init__(
        self,
        context: moderngl.Context,
        geometry: StandingGeometry,
        surfaces: SurfacePrograms,
        unlit: bool,
        reads_depth: bool = True,
    ):
        self._context, self._geometry = context, geometry
        self._reads_depth = reads_depth
        variants = [variant_of(look.material, unlit, look.shading) for look in geometry.looks]
        self._programs = [surfaces[variant] for variant in variants]
        self.programs = frozenset(self._programs)
        chunks = geometry.chunks
        self._middles_m = 0.5 * (chunks.lows.astype(np.float64) + chunks.highs)
        self._halves_m = 0.5 * (chunks.highs.astype(np.float64) - chunks.lows)
        self._radii_m = np.linalg.norm(self._halves_m, axis=1)
        ends = np.stack((chunks.lows, chunks.highs), axis=1)
        self._corners_m = np.stack(
            [ends[:, (x, y, z), (0, 1, 2)] for x in (0, 1) for y in (0, 1) for z in (0, 1)], axis=1
        )
        double_sided = np.array([look.material.double_sided for look in geometry.looks], dtype=bool)
        self._spreads = np.where(double_sided[geometry.look_of_chunk], 2.0, chunks.spreads)
        self._make_room(_INDEX_BYTES * int(chunks.count.sum()))
        self._calls: list[list[tuple[int, int, int]]] = []
        self.triangles = 0

    def prepare(self, views: Sequence[FaceView], viewpoint_m: NDArray[np.float64]) -> None:
        """Find what each view may see, and what of that to draw first: what hides others.

        Args:
            views: the faces.
            viewpoint_m: (3,), world.
        """
        geometry = self._geometry
        here_from_anchor = np.eye(4)
        here_from_anchor[:3, 3] = geometry.anchor_m - viewpoint_m
        self._here_from_anchor = columns_first(here_from_anchor)
        self._clip_from_anchor = (
            np.stack([view.clip_from_here for view in views]) @ here_from_anchor
        )
        self._clip_matrices = columns_first(self._clip_from_anchor)
        middles_m = self._middles_m + here_from_anchor[:3, 3]
        distances_m = np.linalg.norm(middles_m, axis=1)
        self._far_ends_m = distances_m + self._radii_m
        fronts = np.flatnonzero(~self._all_turned_away(middles_m, distances_m))
        in_view = self._in_view(views, middles_m[fronts], self._halves_m[fronts])
        view_of_draw, found = np.nonzero(in_view)
        seen = _Draws(view_of_draw, fronts[found])
        self._views = views
        near_m = np.maximum(distances_m - self._radii_m, 1e-3)
        is_large = geometry.chunks.widths > OCCLUDER_RAD * near_m
        first = is_large[seen.chunk]
        counts = geometry.chunks.count[seen.chunk]
        self._rest: _Draws | None = seen.where(~first)
        if not self._reads_depth or counts[~first].sum() < WORTH_A_TEST:
            self._rest, first = None, np.ones(len(first), dtype=np.bool_)
        self.triangles = 0
        self._plan(seen.where(first))

    @property
    def has_more(self) -> bool:
        """Whether something is left to draw that may be hidden."""
        return self._rest is not None

    def prepare_rest(self, depth: NDArray[np.float32]) -> None:
        """Find what is left to draw, behind the depth (height, width) of what was drawn."""
        coarse = CoarseDepth(depth)
        rest = self._rest
        faces = [view.face for view in self._views]
        tiles = np.array([(face.left_px, face.top_px, *face.tile_px) for face in faces])
        boxes = outlines(
            self._corners_m[rest.chunk], self._clip_from_anchor[rest.view], tiles[rest.view]
        )
        self._plan(rest.where(~coarse.hides(boxes)))

    def draw(self, number: int) -> None:
        """Draw what a view sees."""
        context, geometry = self._context, self._geometry
        context.front_face = "cw"
        placed, last = set(), -1
        for look, first, count in self._calls[number]:
            program, material = self._programs[look], geometry.looks[look].material
            if program not in placed:
                placed.add(program)
                program.set_matrices(
                    self._clip_matrices[number], self._here_from_anchor, _NORMAL_FROM_ANCHOR
                )
            if look != last:
                program.set_look(material, geometry.looks[look].texture)
                toggle = context.disable if material.double_sided else context.enable
                toggle(moderngl.CULL_FACE)
                last = look
            self._vertex_arrays[program].render(moderngl.TRIANGLES, vertices=count, first=first)

    def _all_turned_away(
        self, middles_m: NDArray[np.float64], distances_m: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        """Which chunks (n,) show the viewpoint nothing but back sides, which nobody sees.

        A normal is within the spread of the axis, and the direction to a triangle within the radius
        of the direction to the chunk's middle.
        """
        along_m = np.sum(self._geometry.chunks.axes * middles_m, axis=1)
        away_m = self._spreads * distances_m + self._radii_m
        return along_m > away_m + _SPARE * distances_m

    def _in_view(
        self,
        views: Sequence[FaceView],
        middles_m: NDArray[np.float64],
        halves_m: NDArray[np.float64],
    ) -> NDArray[np.bool_]:
        """Which boxes (views, n) a view may see: none of its planes has all of a box behind it."""
        planes = np.stack([view.planes for view in views])  # (views, 6, 4)
        normals = planes[..., :3].reshape(-1, 3)
        inside_m = normals @ middles_m.T + np.abs(normals) @ halves_m.T
        inside_m += planes[..., 3].reshape(-1, 1) + _SPARE
        return (inside_m >= 0.0).reshape(*planes.shape[:2], -1).all(axis=1)

    def _plan(self, draws: _Draws) -> None:
        """Put draws into an order, and those of one call beside each other."""
        self._calls = [[] for _ in self._views]
        if not draws.chunk.size:
            return
        geometry = self._geometry
        far_m = self._far_ends_m[draws.chunk]
        band = _bands(far_m, self._radii_m[draws.chunk])
        look = geometry.look_of_chunk[draws.chunk]
        call = (draws.view * BANDS + band) * max(len(geometry.looks), 1) + look
        order = np.lexsort((far_m, call))
        call = call[order]
        begins = np.flatnonzero(np.diff(call, prepend=-1))
        # of each call, in indices
        ends = 3 * np.cumsum(geometry.chunks.count[draws.chunk[order]])
        firsts = np.concatenate(([0], ends))[begins]
        counts = np.diff(firsts, append=ends[-1])
        for draw, first, count in zip(order[begins], firsts.tolist(), counts.tolist(), strict=True):
            self._calls[draws.view[draw]].append((int(look[draw]), first, count))
        indices = geometry.indices(draws.chunk[order])
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


def _bands(far_m: NDArray[np.float64], radii_m: NDArray[np.float64]) -> NDArray[np.intp]:
    """Bands (n,) of distance: each hides about as much of what is behind it as the next."""
    order = np.argsort(far_m, kind="stable")
    nearer = np.cumsum((radii_m[order] / np.maximum(far_m[order], 1e-9)) ** 2)
    bands = np.empty(len(far_m), dtype=np.intp)
    bands[order] = np.minimum(BANDS * nearer / max(float(nearer[-1]), 1e-30), BANDS - 1)
    return bands
