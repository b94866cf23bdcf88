"""Hierarchical depth of an atlas with its tiles by direction, for rays beside its viewpoint."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.core.cube import FACE_FROM_RIG, FACE_NAMES
from omnisim.rendering.opengl.atlas.tile_plan import Tile, TilePlan
from omnisim.rendering.opengl.gl.gpu_textures import texture_2d
from omnisim.rendering.opengl.gl.memory import gpu_allocation
from omnisim.rendering.opengl.gl.uniforms import columns_first, find_uniform, uniform

_CELLS = 64  # per face side; tiles end at cell edges; as in first_surface.glsl
_BLOCK, _BLOCKS_PER_GROUP = 8, 8  # texels per side, as there
_DEPTH, _BLOCKS, _CELL_TILES = 8, 9, 10  # texture units


class DepthPyramid:
    """Depth textures for programs that include `capture/first_surface.glsl`.

    Args:
        context: OpenGL context.
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
        size = plan.width_px, plan.height_px
        blocks = -(-plan.width_px // _BLOCK), -(-plan.height_px // _BLOCK)
        with gpu_allocation(f"depth of {size[0]} × {size[1]} px", "make the image smaller"):
            self._depth = texture_2d(context, size, 1)
            self._blocks = texture_2d(context, blocks, 2)
            cells = _cell_tiles(plan)
            self._cells = texture_2d(context, cells.shape[1::-1], 4, cells)
        share = near_m / (far_m - near_m)  # depth is −share + near (1 + share) / z
        scale = 1.0 / (near_m * (1.0 + share))
        self._inverse_z_from_depth = (scale, share * scale)
        self._near_m, self._longest_m = near_m, longest_m
        self._nearest: list[moderngl.Uniform] = []

    def bind_program(self, program: moderngl.Program) -> None:
        """Set the constant uniforms of a program; `update` sets the rest."""
        for name, value in (
            ("u_depth", _DEPTH),
            ("u_blocks", _BLOCKS),
            ("u_cells", _CELL_TILES),
            ("u_inverse_z_from_depth", self._inverse_z_from_depth),
            ("u_near_m", self._near_m),
        ):
            member = find_uniform(program, name)
            if member is not None:
                member.value = value
        uniform(program, "u_face_from_rig").write(columns_first(FACE_FROM_RIG))
        nearest = find_uniform(program, "u_nearest")
        if nearest is not None:
            self._nearest.append(nearest)

    def update(self, depth: NDArray[np.float32]) -> None:
        """Take the depth (height, width) of the atlas, and bind the textures."""
        self._depth.write(depth)
        blocks = _largest(depth, _BLOCK)
        scale, offset = self._inverse_z_from_depth
        blocks = np.where(blocks > 0.0, np.float32(scale) * blocks + np.float32(offset), 0.0)
        self._blocks.write(np.stack((_dilated(blocks), _dilated_groups(blocks)), axis=-1))
        nearest = float(blocks.max())
        if nearest > 0.0:
            nearest = 1.0 / max(1.0 / nearest - self._longest_m, self._near_m)
        for one in self._nearest:
            one.value = nearest
        for texture, unit in ((self._depth, _DEPTH), (self._blocks, _BLOCKS)):
            texture.use(unit)
        self._cells.use(_CELL_TILES)


def _cell_tiles(plan: TilePlan) -> NDArray[np.float32]:
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


def _largest(values: NDArray[np.float32], side: int) -> NDArray[np.float32]:
    """Maximum of each square of `side` × `side` values, smaller at the far edges."""
    height, width = values.shape
    whole = height - height % side
    # rows first, full ones at once: far quicker than one after the other
    rows = values[:whole].reshape(-1, side, width).max(axis=1)
    if whole < height:
        rows = np.concatenate((rows, values[whole:].max(axis=0, keepdims=True)))
    maxima: NDArray[np.float32] = np.maximum.reduceat(rows, range(0, width, side), axis=1)
    return maxima


def _dilated(blocks: NDArray[np.float32]) -> NDArray[np.float32]:
    """Maximum over each block and its eight neighbors."""
    rows = np.pad(blocks, 1, mode="edge")
    rows = np.maximum(np.maximum(rows[:-2], rows[1:-1]), rows[2:])
    maxima: NDArray[np.float32] = np.maximum(np.maximum(rows[:, :-2], rows[:, 1:-1]), rows[:, 2:])
    return maxima


def _dilated_groups(blocks: NDArray[np.float32]) -> NDArray[np.float32]:
    """Maximum over each group of blocks and its neighbors, per block."""
    groups = _dilated(_largest(blocks, _BLOCKS_PER_GROUP))
    columns = groups.repeat(_BLOCKS_PER_GROUP, axis=0)[: blocks.shape[0]]
    return columns.repeat(_BLOCKS_PER_GROUP, axis=1)[:, : blocks.shape[1]]
