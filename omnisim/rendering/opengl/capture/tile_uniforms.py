"""Uniforms of `capture/tiles.glsl`: the tiles of an atlas, by face."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.core.cube import FACE_FROM_RIG, FACE_NAMES
from omnisim.rendering.opengl.atlas.tile_plan import MAX_TILES, TilePlan
from omnisim.rendering.opengl.gl.uniforms import columns_first, find_uniform


def bind_tiles(
    program: moderngl.Program, plan: TilePlan, rig_from_optical: NDArray[np.float64]
) -> None:
    """Set a program's uniforms of tiles, mip levels, and rig_from_optical (3, 3)."""
    regions, padded, uv_from_tangent = (
        np.zeros((MAX_TILES, 4), dtype=np.float32) for _ in range(3)
    )
    px_per_tan = np.zeros(MAX_TILES, dtype=np.float32)
    atlas_px = np.array([plan.width_px, plan.height_px], dtype=np.float64)
    for index, tile in enumerate(plan.tiles):
        half_px = 0.5 * tile.face_size_px
        middle_px = np.array(tile.face_corner_px) + half_px
        uv_from_tangent[index] = np.concatenate((middle_px / atlas_px, half_px / atlas_px))
        regions[index] = np.ravel(tile.region)
        padded[index] = tile.padded_region.ravel()
        px_per_tan[index] = half_px
    face_of_tile = [tile.face for tile in plan.tiles]
    first_tiles = np.searchsorted(face_of_tile, np.arange(len(FACE_NAMES) + 1))
    for name, values in (
        ("u_max_level", np.float32(plan.max_level)),
        ("u_level_bias", np.float32(plan.level_bias)),
        ("u_atlas_px", atlas_px.astype("<f4")),
        ("u_rig_from_optical", columns_first(rig_from_optical)),
        ("u_face_from_rig", columns_first(FACE_FROM_RIG)),
        ("u_first_tile", first_tiles.astype("<i4")),
        ("u_tile_region", regions),
        ("u_tile_padded_region", padded),
        ("u_uv_from_tangent", uv_from_tangent),
        ("u_tile_px_per_tan", px_per_tan),
    ):
        uniform = find_uniform(program, name)
        if uniform is not None:
            uniform.write(values)
