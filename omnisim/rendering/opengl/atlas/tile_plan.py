"""Atlas tiles: the parts of the cube faces that a camera needs, and their texels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera
from omnisim.core.cube import FACE_FROM_RIG, FACE_NAMES, face_index, face_tangents
from omnisim.core.errors import GraphicsError
from omnisim.rendering.opengl.atlas.sampling_density import (
    GRID,
    WHOLE_FACE,
    RegionDensity,
    SamplingDensity,
    density_of_camera,
)

# The largest density lies between two samples at worst: a margin of 1 %.
DENSITY_MARGIN = 1.01
MIN_FACE_PX = 16
MAX_TILES = 64
# Cost of an additional tile: triangles at its edge are drawn again. In texels, and as a share of
# all texels, so that large images keep few tiles.
TILE_TEXELS = 8000.0
TILE_SHARE = 0.005


@dataclass(frozen=True)
class Tile:
    """Virtual camera: a rectangle of a cube face, and its place in the atlas.

    Attributes:
        face: index into `omnisim.core.cube.FACE_NAMES`.
        face_size_px: texels across the 90° of the whole face.
        origin_px: first texel (right, down) from the face's top left corner; negative if the tile
            begins outside of the face.
        size_px: width and height, gutter included.
        region: tangents (right, down) of the top left and the bottom right corner of the region
            that is looked up in this tile only.
        left_px, top_px: position in the atlas.
    """

    face: int
    face_size_px: int
    origin_px: tuple[int, int]
    size_px: tuple[int, int]
    region: tuple[tuple[float, float], tuple[float, float]]
    left_px: int = 0
    top_px: int = 0

    @property
    def face_name(self) -> str:
        """Name of the face."""
        return FACE_NAMES[self.face]

    @property
    def face_corner_px(self) -> tuple[int, int]:
        """Left and top that the whole face would have in the atlas."""
        return self.left_px - self.origin_px[0], self.top_px - self.origin_px[1]

    @property
    def padded_region(self) -> NDArray[np.float64]:
        """Tangents (2, 2) of the top left and the bottom right corner, gutter included."""
        origin = np.array(self.origin_px, dtype=np.float64)
        return -1.0 + 2.0 * np.stack((origin, origin + self.size_px)) / self.face_size_px


@dataclass(frozen=True)
class TilePlan:
    """Virtual cameras of a sensor, and the atlas that holds them.

    Attributes:
        tiles: tiles of the atlas, sorted by face.
        max_level: highest mip level that lookups reach.
        level_bias: offset from the mip level whose texels are as wide as a lookup's footprint.
        width_px, height_px: size of the atlas.
    """

    tiles: tuple[Tile, ...]
    max_level: int
    level_bias: float
    width_px: int
    height_px: int

    @property
    def texels(self) -> int:
        """Number of texels of all tiles."""
        return sum(tile.size_px[0] * tile.size_px[1] for tile in self.tiles)

    def fits(self, side_px: int, max_texels: int) -> bool:
        """True if the atlas has no longer side and no more texels."""
        sides_px = self.width_px, self.height_px
        return max(sides_px) <= side_px and math.prod(sides_px) <= max_texels

    @property
    def rectangles_px(self) -> NDArray[np.float64]:
        """Left, top, width and height (tiles, 4) of each tile in the atlas."""
        return np.array([(one.left_px, one.top_px, *one.size_px) for one in self.tiles], np.float64)


def plan_tiles(
    camera: CentralCamera,
    rig_from_optical: NDArray[np.float64],
    texels_per_pixel: float = 1.0,
    *,
    face_size_px: int | None = None,
    also_seen: NDArray[np.float64] | None = None,
    subdivide: bool = False,
    level_bias: float = 0.0,
) -> TilePlan:
    """Plan the rectangle of each cube face that a camera sees.

    Without a face size, each face gets the texels that the densest part of the image on it needs,
    so that nothing is magnified except at an image's poles (`sampling_density`).

    Args:
        camera: camera model.
        rig_from_optical: (3, 3) rotation from the optical frame to the rig.
        texels_per_pixel: texels per side of the image's smallest pixels.
        face_size_px: texels across the 90° of every face; None: as the density requires.
        also_seen: directions (n, 3), optical frame, that are looked up beyond the camera model's
            field of view, because a mesh's rim has corners.
        subdivide: cut faces into tiles of different density where that saves texels.
        level_bias: offset from the mip level whose texels are as wide as a pixel; negative is
            sharper. Lookups are bilinear: at −1, two texels per pixel, they still cover everything.

    Raises:
        GraphicsError: the camera sees nothing.
    """
    seen = _image_rays(camera)
    if also_seen is not None:
        seen = np.concatenate((seen, also_seen))
    directions_rig = seen @ rig_from_optical.T
    face_of_ray = face_index(directions_rig)
    densities = [
        density_of_camera(
            camera,
            FACE_FROM_RIG[face] @ rig_from_optical,
            face_tangents(directions_rig[face_of_ray == face], face),
        )
        for face in range(len(FACE_NAMES))
    ]
    return plan_densities(densities, texels_per_pixel, face_size_px, subdivide, level_bias)


def plan_densities(
    densities: Sequence[SamplingDensity],
    texels_per_pixel: float,
    face_size_px: int | None,
    subdivide: bool,
    level_bias: float,
    max_level: int | None = None,
    gutter_px: int = 1,
) -> TilePlan:
    """Plan the tiles of each cube face, in the order of `omnisim.core.cube.FACE_NAMES`.

    Args:
        densities: density of the image on each face.
        texels_per_pixel, face_size_px, subdivide, level_bias: see `plan_tiles`.
        max_level: highest mip level; None: as the densities require.
        gutter_px: minimum gutter around tiles.

    Raises:
        GraphicsError: no face is seen.
    """
    whole = [(face, one) for face, density in enumerate(densities) for one in density.whole()]
    if not whole:
        raise GraphicsError("camera: no pixel of the image sees anything of the scene")
    plan = _plan(whole, texels_per_pixel, face_size_px, level_bias, max_level, gutter_px)
    if subdivide and face_size_px is None:
        texels = sum(_texels(region, texels_per_pixel) for _, region in whole)
        tile_texels = max(TILE_TEXELS, TILE_SHARE * texels)
        parts = [
            (face, part)
            for face, density in enumerate(densities)
            for part in density.subdivide(texels_per_pixel, tile_texels)
        ]
        if 0 < len(parts) <= MAX_TILES:
            # a gutter is as wide as the largest mip texel: it may cost what cutting saves
            subdivided = _plan(
                parts, texels_per_pixel, face_size_px, level_bias, max_level, gutter_px
            )
            plan = min(subdivided, plan, key=lambda one: one.texels)
    return plan


def whole_faces(plan: TilePlan) -> TilePlan:
    """Plan with each of the faces in a single padded tile, as dense as the face's densest tile."""
    sizes: dict[int, int] = {}
    for tile in plan.tiles:
        sizes[tile.face] = max(tile.face_size_px, sizes.get(tile.face, 0))
    tiles = [_tile(face, size_px, WHOLE_FACE, WHOLE_FACE, 1) for face, size_px in sizes.items()]
    return pack_tiles(tiles, 0, 0.0)


def cube_plan(face_size_px: int) -> TilePlan:
    """Plan with all six faces whole, without mip levels."""
    faces = range(len(FACE_NAMES))
    return pack_tiles(
        [_tile(face, face_size_px, WHOLE_FACE, WHOLE_FACE, 1) for face in faces], 0, 0.0
    )


def _plan(
    regions: list[tuple[int, RegionDensity]],
    texels_per_pixel: float,
    face_size_px: int | None,
    level_bias: float,
    max_level: int | None,
    gutter_px: int,
) -> TilePlan:
    """One tile per region of a face."""
    sizes = [
        max(MIN_FACE_PX, math.ceil(2.0 * DENSITY_MARGIN * texels_per_pixel * one.max_px_per_tan))
        if face_size_px is None
        else face_size_px
        for _, one in regions
    ]
    minification = max(
        0.5 * size / one.min_px_per_tan for size, (_, one) in zip(sizes, regions, strict=True)
    )
    level = round(math.log2(minification) + level_bias) if max_level is None else max_level
    level = max(0, min(level, int(math.log2(min(sizes)))))
    tiles = [
        _tile(face, size, one.region, one.seen_region, max(1 << level, gutter_px))
        for size, (face, one) in zip(sizes, regions, strict=True)
    ]
    return pack_tiles(tiles, level, level_bias)


def _texels(region: RegionDensity, texels_per_pixel: float) -> float:
    """Approximate number of texels of a tile."""
    extent = region.seen_region[1] - region.seen_region[0]
    return float(np.prod(extent * texels_per_pixel * region.max_px_per_tan))


def _tile(
    face: int,
    face_size_px: int,
    region: NDArray[np.float64],
    seen_region: NDArray[np.float64],
    step: int,
) -> Tile:
    """Tile around visible tangents (2, 2), without a position in the atlas.

    Tiles, and their faces, begin at multiples of `step`, and the gutter is one whole step: no mip
    texel mixes two tiles, and a lookup at the very edge of the visible region still finds a whole
    texel of its own face.
    """
    texels = 0.5 * face_size_px * (np.clip(seen_region, -1.0, 1.0) + 1.0) / step
    first = step * (np.floor(texels[0]).astype(int) - 1)
    last = step * (np.ceil(texels[1]).astype(int) + 1)
    left, top = first.tolist()
    width, height = (last - first).tolist()
    (first_x, first_y), (last_x, last_y) = region.tolist()
    corners = ((first_x, first_y), (last_x, last_y))
    return Tile(face, face_size_px, (left, top), (width, height), corners)


def pack_tiles(tiles: Sequence[Tile], level: int, level_bias: float) -> TilePlan:
    """Pack tiles into rows, tallest first, in a roughly square atlas."""
    widest = max(tile.size_px[0] for tile in tiles)
    texels = sum(tile.size_px[0] * tile.size_px[1] for tile in tiles)
    width_px = max(widest, 1 << math.ceil(math.log2(math.sqrt(texels))))
    packed: list[Tile] = []
    left_px = top_px = row_px = 0
    for tile in sorted(tiles, key=lambda tile: -tile.size_px[1]):
        if left_px + tile.size_px[0] > width_px:
            left_px, top_px, row_px = 0, top_px + row_px, 0
        packed.append(replace(tile, left_px=left_px, top_px=top_px))
        left_px += tile.size_px[0]
        row_px = max(row_px, tile.size_px[1])
    used_px = max(tile.left_px + tile.size_px[0] for tile in packed)
    packed.sort(key=lambda tile: (tile.face, tile.region))
    return TilePlan(tuple(packed), level, level_bias, used_px, top_px + row_px)


def _image_rays(camera: CentralCamera) -> NDArray[np.float64]:
    """Directions (n, 3), optical frame, that the image sees, edges and corners included.

    A small image from a long lens falls between the samples of a face's grid.
    """
    u = np.linspace(-0.5, camera.width_px - 0.5, min(GRID, camera.width_px + 2))
    v = np.linspace(-0.5, camera.height_px - 0.5, min(GRID, camera.height_px + 2))
    rays = camera.ray_from_pixel(np.stack(np.meshgrid(u, v), axis=-1))
    return rays.directions[rays.valid]
