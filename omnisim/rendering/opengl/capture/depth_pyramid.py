"""Hierarchical depth of an atlas with its tiles by direction, for rays beside its viewpoint."""

from __future__ import annotations

import moderngl
import numpy as np

from omnisim.core.array_types import Float32s
from omnisim.core.cube import FACE_FROM_RIG, FACE_NAMES
from omnisim.rendering.opengl.atlas.tile_plan import Tile, TilePlan
from omnisim.rendering.opengl.gl.buffers import gpu_buffer
from omnisim.rendering.opengl.gl.functions import StorageBindings
from omnisim.rendering.opengl.gl.gpu_textures import copy_textures, depth_texture, texture_2d
from omnisim.rendering.opengl.gl.memory import gpu_allocation
from omnisim.rendering.opengl.gl.shader_files import (
    build_compute_shader,
    columns_first,
    set_uniforms,
    uniform,
)

_CELLS = 64  # per face side; tiles end at cell edges; as in first_surface.glsl
_BLOCK, _BLOCKS_PER_GROUP = 8, 8  # per side, as in depth_bounds.comp
_GROUP_SIZE = 8  # invocations per side, as there
_DEPTH, _BLOCKS, _CELL_TILES = 8, 9, 10  # texture units


class DepthPyramid:
    """Depth textures for programs that include `capture/first_surface.glsl`.

    Args:
        plan: tiles of the atlas, whose regions end at multiples of 1/32.
        near_m, far_m: clip planes of the virtual cameras; far may be infinite.
        longest_m: maximum distance of the rays' origins from the viewpoint.

    Raises:
        GraphicsError: out of GPU memory.
    """

    def __init__(
        self,
        context: moderngl.Context,
        plan: TilePlan,
        near_m: float,
        far_m: float,
        longest_m: float,
    ):
        self._context, size = context, (plan.width_px, plan.height_px)
        columns, rows = (-(-side // _BLOCK) for side in size)
        groups = -(-columns // _BLOCKS_PER_GROUP) * -(-rows // _BLOCKS_PER_GROUP)
        with gpu_allocation(f"depth of {size[0]} × {size[1]} px", "make the image smaller"):
            self._depth = depth_texture(context, size)
            self._bounds = texture_2d(context, (columns, rows + 1), 2)
            cells = _cell_tiles(plan)
            self._cells = texture_2d(context, cells.shape[1::-1], 4, cells)
            no_surface = np.zeros(1 + groups, dtype="<u4")
            self._empty = gpu_buffer(context, no_surface)
            self._groups = gpu_buffer(context, no_surface)
            self._buffers = StorageBindings([gpu_buffer(context, 4 * columns * rows), self._groups])
        share = near_m / (far_m - near_m)  # depth is −share + near (1 + share) / z
        scale = 1.0 / (near_m * (1.0 + share))
        self._inverse_z_from_depth = (scale, share * scale)
        self._work_groups = -(-columns // _GROUP_SIZE), -(-rows // _GROUP_SIZE)
        self._find = build_compute_shader(context, "capture/depth_bounds.comp")
        self._find["u_inverse_z_from_depth"] = self._inverse_z_from_depth
        self._dilate = build_compute_shader(context, "capture/depth_bounds.comp", ("DILATE",))
        self._dilate["u_near_m"], self._dilate["u_longest_m"] = near_m, longest_m
        for program in (self._find, self._dilate):
            program["u_depth"] = _DEPTH
        self._near_m = near_m

    def bind_program(self, program: moderngl.Program) -> None:
        """Set the uniforms of a program."""
        values = {
            "u_depth": _DEPTH,
            "u_blocks": _BLOCKS,
            "u_cells": _CELL_TILES,
            "u_inverse_z_from_depth": self._inverse_z_from_depth,
            "u_near_m": self._near_m,
        }
        set_uniforms(program, values)
        uniform(program, "u_face_from_rig").write(columns_first(FACE_FROM_RIG))

    def update(self, depth: moderngl.Texture) -> None:
        """Copy the depth of the atlas, find its bounds, and bind the textures.

        The copy is never attached to a target: it may stay bound while the next image is drawn.
        """
        context = self._context
        copy_textures({depth: self._depth})
        context.copy_buffer(self._groups, self._empty)
        self._buffers.bind()
        for texture, unit in (
            (self._depth, _DEPTH), (self._bounds, _BLOCKS), (self._cells, _CELL_TILES)
        ):  # fmt: skip
            texture.use(unit)
        self._find.run(*self._work_groups)
        context.memory_barrier(context.SHADER_STORAGE_BARRIER_BIT)
        self._bounds.bind_to_image(0, read=False)
        self._dilate.run(*self._work_groups)
        context.memory_barrier(
            context.TEXTURE_FETCH_BARRIER_BIT | context.BUFFER_UPDATE_BARRIER_BIT
        )


def _cell_tiles(plan: TilePlan) -> Float32s:
    """Offset and scale from tangents to texels (cells, faces × cells, 4); 0: not in any tile."""
    cell_tiles = np.zeros((_CELLS, len(FACE_NAMES), _CELLS, 4), dtype=np.float32)
    for tile in plan.tiles:
        half_px = 0.5 * tile.face_size_px
        left, top = tile.face_corner_px
        columns, rows = _whole_cells(tile)
        cell_tiles[rows, tile.face, columns] = (left + half_px, top + half_px, half_px, half_px)
    return cell_tiles.reshape(_CELLS, -1, 4)


def _whole_cells(tile: Tile) -> tuple[slice, slice]:
    """Columns and rows of the face's cells that lie inside a tile."""
    (first_x, first_y), (last_x, last_y) = tile.region
    (drawn_left, drawn_top), (drawn_right, drawn_bottom) = tile.padded_region.tolist()
    slices = []
    for first, last, drawn_first, drawn_last in (
        (first_x, last_x, drawn_left, drawn_right),
        (first_y, last_y, drawn_top, drawn_bottom),
    ):
        begins = np.ceil(0.5 * _CELLS * (max(first, drawn_first) + 1.0) - 1e-6)
        ends = np.floor(0.5 * _CELLS * (min(last, drawn_last) + 1.0) + 1e-6)
        slices.append(slice(max(0, int(begins)), max(0, int(ends))))
    return slices[0], slices[1]
