"""Static depth of the cascades that follow the viewpoint, kept while they move.

Each cascade is kept on a torus over a world grid: when it moves, only the cells that enter it are
drawn. The drawn depth depends on the cell only, not on where the cascade was before, because all
cells of a period of the torus are drawn with the same matrix into the same place. A scissor
separates them, as clipping would move edges.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.opengl.gl.framebuffers import use_target
from omnisim.rendering.opengl.gl.gpu_textures import CLEAR_DEPTH
from omnisim.rendering.opengl.shadows.cascades import CELLS, Cascades
from omnisim.rendering.opengl.shadows.caster_drawer import CasterDrawer, MapPart
from omnisim.rendering.opengl.shadows.depth_levels import DepthLevels
from omnisim.rendering.opengl.shadows.lamp_views import orthographic_clip
from omnisim.rendering.opengl.shadows.shadow_plan import ShadowPlan
from omnisim.rendering.opengl.shadows.torus import Cells, TorusPart, entered_cells, torus_parts


@dataclass(frozen=True, eq=False)
class _Kept:
    """Cascade that follows the viewpoint.

    Attributes:
        cascades: cascades of its light.
        level: its number among them.
        map_px: left, top and size of its map.
        kept_px: left and top of its torus.
    """

    cascades: Cascades
    level: int
    map_px: tuple[int, int, int]
    kept_px: tuple[int, int]

    @property
    def cell_px(self) -> int:
        """Width of a grid cell."""
        return self.map_px[2] // CELLS

    def clip(self, period: tuple[int, int]) -> NDArray[np.float64]:
        """Matrix (4, 4) clip_from_anchor of a period of the torus."""
        half_m = self.cascades.halves_m[self.level]
        middle_m = (2.0 * np.array(period) + 1.0) * half_m
        return orthographic_clip(self.cascades.axes, middle_m, half_m, self.cascades.depths_m)

    def on_torus_px(self, cells: Cells) -> tuple[int, int, int, int]:
        """Left, top, width and height of cells of the torus in the texture of all."""
        left, top, width, height = (self.cell_px * one for one in cells)
        return self.kept_px[0] + left, self.kept_px[1] + top, width, height

    def on_map_px(self, cells: Cells, first: tuple[int, int]) -> tuple[int, int, int, int]:
        """The same of cells of the grid on the map that begins at cell `first`."""
        left, top = cells.left - first[0], cells.top - first[1]
        left, top, width, height = (self.cell_px * one for one in (left, top, *cells[2:]))
        return self.map_px[0] + left, self.map_px[1] + top, width, height

    def map_part(self, part: TorusPart) -> MapPart:
        """Part of the torus to be drawn."""
        clip = self.clip(part.period)
        place = np.array(part.place, dtype=np.float64)
        scale = CELLS / place[2:]
        narrow = np.diag((*scale, 1.0, 1.0))
        narrow[:2, 3] = scale - 2.0 * place[:2] / place[2:] - 1.0
        size_px = self.map_px[2]
        whole_px = *self.kept_px, size_px, size_px
        return MapPart(clip, narrow @ clip, whole_px, self.on_torus_px(part.place))


class KeptCascades:
    """Cascades that follow the viewpoint, on their tori.

    Args:
        context: OpenGL context.
        plan: plan with such cascades.
        maps: depth of all maps.
        levels: depth to use if it has the right size.

    Attributes:
        levels: depth of all tori.
    """

    def __init__(
        self,
        context: moderngl.Context,
        plan: ShadowPlan,
        maps: DepthLevels,
        levels: DepthLevels | None = None,
    ):
        self._kept = _kept(plan)
        size_px = plan.kept_size_px
        if levels is None or levels.size_px != size_px:
            levels = DepthLevels(context, size_px, maps)
        self.levels = levels
        self._first: list[tuple[int, int] | None] = [None] * len(self._kept)

    def update(
        self,
        maps: DepthLevels,
        viewpoint_m: NDArray[np.float64],
        drawer: CasterDrawer,
        world_from_objects: Sequence[NDArray[np.float64]],
    ) -> None:
        """Bring the maps of cascades that have moved up to date.

        Args:
            maps: all maps.
            viewpoint_m: (3,) viewpoint relative to the anchor.
            drawer: drawer of the static casters.
            world_from_objects: (4, 4) each, poses of the dynamic objects.
        """
        is_clear = not any(self._first)
        if is_clear:  # quicker than part by part
            use_target(self.levels.target)
            self.levels.target.clear(depth=CLEAR_DEPTH)
        for number, kept in enumerate(self._kept):
            left, top = kept.cascades.first_cells(viewpoint_m)[kept.level].tolist()
            first, old = (left, top), self._first[number]
            if first == old:
                continue
            self._first[number] = None  # if drawing is interrupted
            parts = [
                kept.map_part(part)
                for cells in entered_cells(old, first, CELLS)
                for part in torus_parts(cells, CELLS)
            ]
            self._draw(parts, is_clear, drawer, world_from_objects)
            for part in torus_parts(Cells(*first, CELLS, CELLS), CELLS):
                place_px = kept.on_torus_px(part.place)
                maps.copy(self.levels, kept.on_map_px(part.cells, first), place_px[:2])
            self._first[number] = first

    def _draw(
        self,
        parts: Sequence[MapPart],
        is_clear: bool,
        drawer: CasterDrawer,
        world_from_objects: Sequence[NDArray[np.float64]],
    ) -> None:
        target = self.levels.target
        for part in parts:
            use_target(target)
            if not is_clear:
                target.clear(depth=CLEAR_DEPTH, viewport=part.part_px)
            drawer.draw_part(target, part, world_from_objects)
        self.levels.coarsen([part.part_px for part in parts])


def _kept(plan: ShadowPlan) -> list[_Kept]:
    """All cascades that follow the viewpoint, light by light."""
    lights = [one for one in plan.cascades if one is not None]
    places_px = plan.kept_places_px.tolist()
    return [
        _Kept(
            cascades,
            level,
            (block.left_px + level * block.size_px, block.top_px, block.size_px),
            tuple(places_px[light * (plan.cascade_count - 1) + level]),
        )
        for light, (cascades, block) in enumerate(zip(lights, plan.blocks, strict=False))
        for level in range(plan.cascade_count - 1)
    ]
