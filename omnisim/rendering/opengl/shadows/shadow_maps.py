"""Shadow maps of lamps, and the cascades that stay as long as nothing in them moves."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import NamedTuple

import moderngl
import numpy as np

from omnisim.core.arrays import Bools, Floats, Indices, bounds_of
from omnisim.core.world import Poses, time_of
from omnisim.rendering.opengl.gl.buffers import gpu_allocation, written_buffer
from omnisim.rendering.opengl.gl.framebuffers import depth_target, use_target
from omnisim.rendering.opengl.gl.gpu_textures import copy_region, depth_texture, limit_levels
from omnisim.rendering.opengl.gl.shader_files import build_program, uniform
from omnisim.rendering.opengl.gl.state import CLEAR_DEPTH, GlState
from omnisim.rendering.opengl.shadows.shadow_drawer import CasterDrawer, MapPart
from omnisim.rendering.opengl.shadows.shadow_plan import (
    CELLS,
    Cascades,
    ShadowPlan,
    covered_px,
    make_shadow_plan,
    orthographic_clip,
)
from omnisim.rendering.opengl.world.scene_buffers import SceneBuffers
from omnisim.scene.model import LAMP_NEAR_M, Lighting

_UNIT, _BLOCK_BINDING = 13, 1  # as in shaders/scene/shadow.glsl


class _Views(NamedTuple):
    """Views of all maps."""

    middles_m: Floats  # (lights, cascades, 2) centers of the cascades, which the matrices follow
    clips: Floats  # (maps, 4, 4) clip_from_anchor matrices


class ShadowMaps:
    """Shadow maps of the lamps that cast shadows.

    Args:
        lighting: lighting with at least one light that casts shadows.

    Attributes:
        anchor_m: (3,) origin of the maps' matrices, world.

    Raises:
        GraphicsError: the maps do not fit on the GPU.
    """

    def __init__(self, buffers: SceneBuffers, lighting: Lighting):
        self._buffers, self._lighting = buffers, lighting
        self._maps: list[DepthLevels] = []
        self._kept: KeptCascades | None = None
        self.refresh()

    def refresh(self) -> None:
        """Redraw what the changed buffers require, when it is next needed."""
        buffers, context = self._buffers, self._buffers.context
        boxes_m = _static_boxes_m(buffers)
        self.anchor_m = np.zeros(3)
        if buffers.clustered_geometry is not None:
            self.anchor_m = buffers.clustered_geometry.anchor_m
        elif len(boxes_m):
            self.anchor_m = 0.5 * (boxes_m[:, 0].min(axis=0) + boxes_m[:, 1].max(axis=0))
        limit = int(context.info["GL_MAX_TEXTURE_SIZE"])
        self._plan = plan = make_shadow_plan(self._lighting, boxes_m - self.anchor_m, limit)
        self._rectangles_px = plan.rectangles_px
        size_px = plan.width_px, plan.height_px
        self._drawer = CasterDrawer(
            buffers, self.anchor_m, self._rectangles_px, size_px, plan.follows_viewpoint
        )
        if self._maps and self._maps[0].size_px != size_px:
            self._maps = []
        while len(self._maps) < 1 + self._drawer.has_dynamic:
            with _allocation(size_px):
                like = self._maps[0] if self._maps else None
                self._maps.append(DepthLevels(context, size_px, like))
        if plan.follows_viewpoint:
            with _allocation(plan.kept_size_px):
                levels = None if self._kept is None else self._kept.levels
                self._kept = KeptCascades(context, plan, self._maps[0], levels)
        else:
            self._kept = None
        self._follows = plan.maps_that_follow
        self._drawn: _Views | None = None  # views of the drawn static maps
        at_anchor, _ = self._views(self.anchor_m)
        # empty if all casters have cubes
        self._block = written_buffer(context, plan.block_data(at_anchor.clips))
        self._posed: tuple[float, bytes] | None = None  # when, and where
        self._covered: Indices = np.empty((0, 4), dtype=np.intp)
        objects = np.array(
            [-1 if item.object_index is None else item.object_index for item in buffers.draw_items]
        )
        moves = np.array([item.moves for item in buffers.draw_items], dtype=np.bool_)
        dynamic = np.flatnonzero(moves & buffers.shown())
        self._dynamic = dynamic[np.argsort(objects[dynamic], kind="stable")]
        _, self._first_of_object = np.unique(objects[self._dynamic], return_index=True)

    @property
    def defines(self) -> tuple[str, ...]:
        """Defines of programs that look up shadows."""
        return (*self._plan.defines, f"LAMP_NEAR_M {LAMP_NEAR_M}")

    def are_shared(self, poses: Sequence[tuple[Floats, Sequence[Floats]]]) -> bool:
        """Tell whether poses of rigs and of the dynamic objects all share their maps."""
        at_rest = poses[0][1]
        if self._drawer.has_dynamic and not all(
            world is at_rest
            or (time_of(world) == time_of(at_rest) and np.array_equal(world, at_rest))
            for _, world in poses
        ):
            return False
        if not self._plan.follows_viewpoint:
            return True
        first, *others = (self._middles_m(rig[:3, 3]) for rig, _ in poses)
        return all(np.array_equal(other, first) for other in others)

    def connect(self, program: moderngl.Program) -> None:
        """Set the samplers and blocks of a program that looks up shadows."""
        if "u_shadow_maps" in program:
            program["u_shadow_maps"] = _UNIT

    def prepare(self, viewpoint_m: Floats, world_from_objects: Poses) -> None:
        """Draw the maps that a frame needs, and bind them; see `ShadowSource`."""
        views, stale = self._views(viewpoint_m)
        clips = views.clips
        if stale.any():
            if self._drawn is None:  # the static casters, in maps that do not follow the viewpoint
                fixed, first = ~self._follows, self._maps[0]
                use_target(first.target)
                first.target.clear(depth=CLEAR_DEPTH)  # of all maps: the others are copied later
                self._drawer.draw(first.target, clips, fixed, world_from_objects, dynamic=False)
                first.coarsen(self._rectangles_px[fixed].astype(int).tolist())
            if self._kept is not None:
                at_m = viewpoint_m - self.anchor_m
                self._kept.update(self._maps[0], at_m, self._drawer, world_from_objects)
            self._block.write(self._plan.block_data(clips))
            self._drawn = views
        if len(self._maps) > 1:
            self._draw_dynamic(clips, stale, world_from_objects)
        self._maps[-1].texture.use(_UNIT)
        self._block.bind_to_uniform_block(_BLOCK_BINDING)

    def _views(self, viewpoint_m: Floats) -> tuple[_Views, Bools]:
        """Views for a viewpoint (3,), world, and the mask (maps,) of those not yet drawn."""
        middles_m, drawn = self._middles_m(viewpoint_m), self._drawn
        if drawn is not None and np.array_equal(middles_m, drawn.middles_m):
            return drawn, np.zeros(len(drawn.clips), dtype=np.bool_)
        clips = self._plan.clips(middles_m, self.anchor_m)
        if drawn is None:
            return _Views(middles_m, clips), np.ones(len(clips), dtype=np.bool_)
        return _Views(middles_m, clips), np.any(clips != drawn.clips, axis=(1, 2))

    def _middles_m(self, viewpoint_m: Floats) -> Floats:
        return self._plan.middles_m(viewpoint_m - self.anchor_m)

    def _draw_dynamic(self, clips: Floats, stale: Bools, world_from_objects: Poses) -> None:
        """Draw the dynamic casters, and restore the static map where they were before."""
        time_s = time_of(world_from_objects) if self._buffers.deforming.size else 0.0
        posed = time_s, np.array(world_from_objects).tobytes()
        if posed == self._posed and not stale.any():
            return
        whole = self._rectangles_px[stale].astype(np.intp)
        static, live = self._maps
        for rectangle_px in np.concatenate((whole, self._covered)).tolist():
            live.copy(static, rectangle_px)
        transforms = self._buffers.instance_transforms(self.anchor_m, world_from_objects)
        self._covered = covered_px(
            clips,
            self._rectangles_px,
            transforms.centers_m[self._dynamic],
            transforms.radii_m[self._dynamic],
            self._first_of_object,
        )
        every = np.ones(len(clips), dtype=np.bool_)
        self._drawer.draw(live.target, clips, every, world_from_objects, dynamic=True)
        live.coarsen(self._covered.tolist())
        self._posed = posed


def _allocation(size_px: tuple[int, int]) -> AbstractContextManager[None]:
    return gpu_allocation(
        f"shadow maps of {size_px[0]} × {size_px[1]} px", "switch the lamps' shadows off"
    )


def _static_boxes_m(buffers: SceneBuffers) -> Floats:
    """Minimum and maximum corners (n, 2, 3) of the static geometry, world."""
    boxes_m = []
    for item in buffers.draw_items:
        if item.object_index is None:
            low, high = bounds_of(item.mesh.positions)
            linear = item.object_from_mesh[:3, :3]
            middle = linear @ (0.5 * (low + high)) + item.object_from_mesh[:3, 3]
            extent = np.abs(linear) @ (0.5 * (high - low))
            boxes_m.append((middle - extent, middle + extent))
    return np.array(boxes_m, dtype=np.float64).reshape(-1, 2, 3)


# Static depth of the cascades that follow the viewpoint, kept while they move.
#
# Each cascade is kept on a torus over a world grid: when it moves, only the cells that enter it are
# drawn. The drawn depth depends on the cell only, not on where the cascade was before, because all
# cells of a period of the torus are drawn with the same matrix into the same place. A scissor
# separates them, as clipping would move edges.


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
        left, top, width, height = (self.cell_px * cell for cell in cells)
        return self.kept_px[0] + left, self.kept_px[1] + top, width, height

    def on_map_px(self, cells: Cells, first: tuple[int, int]) -> tuple[int, int, int, int]:
        """The same of cells of the grid on the map that begins at cell `first`."""
        left, top = cells.left - first[0], cells.top - first[1]
        left, top, width, height = (self.cell_px * cell for cell in (left, top, *cells[2:]))
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
        lights = [cascade for cascade in plan.cascades if cascade is not None]
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
                kept.map_part(torus_part)
                for cells in entered_cells(old, first, CELLS)
                for torus_part in torus_parts(cells, CELLS)
            ]
            target = self.levels.target
            for part in parts:
                use_target(target)
                if not is_clear:
                    target.clear(depth=CLEAR_DEPTH, viewport=part.part_px)
                drawer.draw_part(target, part, world_from_objects)
            self.levels.coarsen([part.part_px for part in parts])
            for torus_part in torus_parts(Cells(*first, CELLS, CELLS), CELLS):
                place_px = kept.on_torus_px(torus_part.place)
                maps.copy(self.levels, kept.on_map_px(torus_part.cells, first), place_px[:2])
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
    return [cells for cells in entered if cells.width and cells.height]


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
