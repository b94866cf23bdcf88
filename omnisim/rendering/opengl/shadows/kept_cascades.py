"""Static depth of the cascades that follow the viewpoint, kept while they move.

Each cascade is kept on a torus over a world grid: when it moves, only the cells that enter it are
drawn. The drawn depth depends on the cell only, not on where the cascade was before, because all
cells of a period of the torus are drawn with the same matrix into the same place. A scissor
separates them, as clipping would move edges.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import moderngl
import numpy as np

from omnisim.core.arrays import Floats
from omnisim.core.world import Poses
from omnisim.rendering.opengl.gl.framebuffers import depth_target, use_target
from omnisim.rendering.opengl.gl.gpu_textures import copy_region, depth_texture, limit_levels
from omnisim.rendering.opengl.gl.reversed_depth import CLEAR_DEPTH
from omnisim.rendering.opengl.gl.shader_files import build_program, uniform
from omnisim.rendering.opengl.gl.state import GlState
from omnisim.rendering.opengl.shadows.shadow_drawer import CasterDrawer, MapPart
from omnisim.rendering.opengl.shadows.shadow_plan import (
    CELLS,
    Cascades,
    ShadowPlan,
    orthographic_clip,
)


@dataclass(frozen=True, eq=False)
class _Kept:
    """Cascade that follows the viewpoint."""

    cascades: Cascades  # cascades of its light
    level: int  # its number among them
    map_px: tuple[int, int, int]  # left, top and size of its map
    kept_px: tuple[int, int]  # left and top of its torus

    @property
    def cell_px(self) -> int:
        """Width of a grid cell."""
        return self.map_px[2] // CELLS

    def clip(self, period: tuple[int, int]) -> Floats:
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
        plan: plan with such cascades.
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
        lights = [one for one in plan.cascades if one is not None]
        places_px = iter(plan.kept_places_px.tolist())
        self._kept = [
            _Kept(
                cascades,
                level,
                (block.left_px + level * block.size_px, block.top_px, block.size_px),
                tuple(next(places_px)),
            )
            for cascades, block in zip(lights, plan.blocks, strict=False)
            for level in range(plan.cascade_count - 1)
        ]
        size_px = plan.kept_size_px
        if levels is None or levels.size_px != size_px:
            levels = DepthLevels(context, size_px, maps)
        self.levels = levels
        self._first: list[tuple[int, int] | None] = [None] * len(self._kept)

    def update(
        self,
        maps: DepthLevels,
        viewpoint_m: Floats,
        drawer: CasterDrawer,
        world_from_objects: Poses,
    ) -> None:
        """Bring the maps of moved cascades up to date, for a viewpoint (3,) from the anchor."""
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
                kept.map_part(one)
                for cells in entered_cells(old, first, CELLS)
                for one in torus_parts(cells, CELLS)
            ]
            target = self.levels.target
            for part in parts:
                use_target(target)
                if not is_clear:
                    target.clear(depth=CLEAR_DEPTH, viewport=part.part_px)
                drawer.draw_part(target, part, world_from_objects)
            self.levels.coarsen([part.part_px for part in parts])
            for one in torus_parts(Cells(*first, CELLS, CELLS), CELLS):
                place_px = kept.on_torus_px(one.place)
                maps.copy(self.levels, kept.on_map_px(one.cells, first), place_px[:2])
            self._first[number] = first


# Squares of a world grid on a torus: cell p is kept at p modulo the side of the square.
#
# While a square moves over the grid, only the cells that enter it are new. They take the places of
# those that leave it. Periods are repetitions of the torus over the grid.
# Source: Losasso and Hoppe, "Geometry Clipmaps", SIGGRAPH 2004, toroidal access.


class Cells(NamedTuple):
    """Rectangle of grid cells."""

    left: int  # first cell
    top: int
    width: int  # number of cells
    height: int


class TorusPart(NamedTuple):
    """Rectangle within one period of the torus."""

    period: tuple[int, int]  # column and row of the period
    place: Cells  # cells on the torus
    cells: Cells  # the same cells on the grid


def entered_cells(old: tuple[int, int] | None, new: tuple[int, int], side: int) -> list[Cells]:
    """Cells of a square that were not in its old place, as at most two rectangles.

    Args:
        old: first cell of the square's old place; None: it had none.
        new: first cell of its new place.
        side: cells per side.
    """
    left, top = new
    shift_x, shift_y = (0, side) if old is None else (left - old[0], top - old[1])
    if max(abs(shift_x), abs(shift_y)) >= side:
        return [Cells(left, top, side, side)]
    # the new columns, then the new rows of the other columns
    columns, rows = abs(shift_x), abs(shift_y)
    column = left + side - columns if shift_x > 0 else left
    row = top + side - rows if shift_y > 0 else top
    rest = left if shift_x > 0 else left + columns
    entered = [Cells(column, top, columns, side), Cells(rest, row, side - columns, rows)]
    return [one for one in entered if one.width and one.height]


def torus_parts(cells: Cells, side: int) -> list[TorusPart]:
    """Split a rectangle, no larger than the torus, where its `side` cells are closed."""
    return [
        TorusPart(
            (left // side, top // side),
            Cells(left % side, top % side, width, height),
            Cells(left, top, width, height),
        )
        for top, height in _intervals(cells.top, cells.height, side)
        for left, width in _intervals(cells.left, cells.width, side)
    ]


def _intervals(first: int, count: int, side: int) -> Iterator[tuple[int, int]]:
    """First and number of the cells in each period."""
    end = first + count
    while first < end:
        last = min(end, (first // side + 1) * side)
        yield first, last - first
        first = last


# Depth of all shadow maps in one texture, with coarser levels for distant surfaces.
#
# Where one image texel covers many texels of a map, lookups in the finest level would be scattered:
# slow, with flickering shadows. A texel of a coarser level is one of the finest texels that it
# covers, not their mean, so that it holds a depth that the lamp sees.
LEVELS = 4  # as in shaders/scene/shadow.glsl


class DepthLevels:
    """Depth texture with its levels.

    Args:
        size_px: size of the finest level, multiples of the coarsest level's texels.
        like: other depth in the context, whose program is used, too; None: the first.

    Attributes:
        texture: texture for samplers that compare.
        target: the finest level as a render target.
    """

    def __init__(
        self, context: moderngl.Context, size_px: tuple[int, int], like: DepthLevels | None = None
    ):
        self.size_px, self._state = size_px, GlState()
        self.texture = depth_texture(context, size_px, LEVELS)
        self.texture.compare_func = ">="
        self.texture.filter = (moderngl.LINEAR_MIPMAP_NEAREST, moderngl.LINEAR)
        self.target, *self._coarser = (
            depth_target(context, self.texture, size_px, level) for level in range(LEVELS)
        )
        limit_levels(self.texture.glo, 0, LEVELS - 1)
        self._sampler = context.sampler(filter=(moderngl.NEAREST, moderngl.NEAREST))
        self._sampler.compare_func = ""
        if like is not None:
            self._triangle: moderngl.VertexArray = like._triangle
            return
        program = build_program(context, "common/full_screen.vert", "scene/coarser_depth.frag")
        uniform(program, "u_finer").value = 0
        self._triangle = context.vertex_array(program, [])

    def coarsen(self, rectangles_px: Sequence[Sequence[int]]) -> None:
        """Draw the coarser levels of rectangles of the finest: left, top, width and height."""
        if not rectangles_px:
            return
        self.texture.use(0)
        self._sampler.use(0)
        with self._state.setting_depth():
            for level, target in enumerate(self._coarser, start=1):
                limit_levels(self.texture.glo, level - 1, level - 1)
                use_target(target)
                for rectangle_px in rectangles_px:
                    target.viewport = _halved(rectangle_px, level)
                    self._triangle.render(moderngl.TRIANGLES, vertices=3)
        limit_levels(self.texture.glo, 0, LEVELS - 1)
        self._sampler.clear(0)

    def copy(
        self,
        source: DepthLevels,
        rectangle_px: Sequence[int],
        first_px: tuple[int, int] | None = None,
    ) -> None:
        """Copy a rectangle of all levels.

        Args:
            source: where to copy from.
            rectangle_px: left, top, width and height of the target in the finest level.
            first_px: left and top in the source, by which the rectangle moves multiples of the
                coarsest level's texels; None: the same place.
        """
        left_px, top_px = rectangle_px[:2] if first_px is None else first_px
        names = source.texture.glo, self.texture.glo
        for level in range(LEVELS):
            to_left, to_top, *size_px = _halved(rectangle_px, level)
            first = left_px >> level, top_px >> level
            copy_region(*names, level, first, (to_left, to_top), (size_px[0], size_px[1]))


def _halved(rectangle_px: Sequence[int], level: int) -> tuple[int, int, int, int]:
    """Rectangle of a level's texels that covers one of the finest level."""
    left, top, width, height = rectangle_px
    first = left >> level, top >> level
    last = -(-(left + width) >> level), -(-(top + height) >> level)
    return *first, last[0] - first[0], last[1] - first[1]
