"""Atlas tiles: the parts of the cube faces that a camera needs, their texels, and their views."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from omnisim.cameras import CentralCamera, HyperbolicCamera
from omnisim.cameras.mirrors import tessellate
from omnisim.core.arrays import Bools, Floats
from omnisim.core.coordinate_frames import MIRROR_FROM_OPTICAL
from omnisim.core.cube import FACE_FROM_RIG, FACE_NAMES, face_index, face_tangents
from omnisim.core.errors import GraphicsError
from omnisim.rendering.atlas.sampling_density import (
    GRID,
    WHOLE_FACE,
    RegionDensity,
    SamplingDensity,
    density_of_camera,
)
from omnisim.rendering.camera.omnicamera import OmniCamera

# The largest density lies between two samples at worst: a margin of 1 %.
DENSITY_MARGIN = 1.01
MIN_FACE_PX = 16
MAX_TILES = 64
# Cost of an additional tile: triangles at its edge are drawn again. In texels, and as a share of
# all texels, so that large images keep few tiles.
TILE_TEXELS = 8000.0
TILE_SHARE = 0.005
# Mip level bias: at 1 sample per pixel, sampling half a level finer than the pixel's footprint
# gains 1 to 2.5 dB; with more samples, which are averaged, a whole level does, and most cameras
# then need no mip levels.
ONE_SAMPLE_BIAS, SUPERSAMPLED_BIAS = -0.5, -1.0


@dataclass(frozen=True)
class Tile:
    """Virtual camera: a rectangle of a cube face, and its place in the atlas."""

    face: int  # index into `omnisim.core.cube.FACE_NAMES`
    face_size_px: int  # texels across the 90° of the whole face
    # first texel (right, down) from the face's top left corner; negative: outside of the face
    origin_px: tuple[int, int]
    size_px: tuple[int, int]  # width and height, gutter included
    # tangents (right, down) of the top left and the bottom right corner of the region that is
    # looked up in this tile only
    region: tuple[tuple[float, float], tuple[float, float]]
    left_px: int = 0  # in the atlas
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
    def padded_region(self) -> Floats:
        """Tangents (2, 2) of the top left and the bottom right corner, gutter included."""
        origin = np.array(self.origin_px, dtype=np.float64)
        return -1.0 + 2.0 * np.stack((origin, origin + self.size_px)) / self.face_size_px


@dataclass(frozen=True)
class TilePlan:
    """Virtual cameras of a sensor, and the atlas that holds them."""

    tiles: tuple[Tile, ...]  # tiles of the atlas, sorted by face
    max_level: int  # highest mip level that lookups reach
    level_bias: float  # offset from the mip level whose texels are as wide as a lookup's footprint
    width_px: int  # of the atlas
    height_px: int

    @property
    def texels(self) -> int:
        """Number of texels of all tiles."""
        return sum(tile.size_px[0] * tile.size_px[1] for tile in self.tiles)

    @property
    def middle(self) -> Floats:
        """Middle (3,) of what the tiles show, rig, weighted by their texels; of any length."""
        total = np.zeros(3)
        for tile in self.tiles:
            center = np.append(tile.padded_region.mean(axis=0), 1.0)
            weight = math.prod(tile.size_px) / float(np.linalg.norm(center))
            total += weight * (FACE_FROM_RIG[tile.face].T @ center)
        return total

    def fits(self, side_px: int, max_texels: int) -> bool:
        """True if the atlas has no longer side and no more texels."""
        sides_px = self.width_px, self.height_px
        return max(sides_px) <= side_px and math.prod(sides_px) <= max_texels

    @property
    def rectangles_px(self) -> Floats:
        """Left, top, width and height (tiles, 4) of each tile in the atlas."""
        return np.array(
            [(tile.left_px, tile.top_px, *tile.size_px) for tile in self.tiles], np.float64
        )


def sensor_tiles(
    sensor: OmniCamera,
    camera: CentralCamera,
    texels_per_pixel: float,
    face_size_px: int | None = None,
    subdivide: bool = False,
) -> TilePlan:
    """Plan the tiles of a sensor.

    Args:
        camera: its camera model, or that of its supersampled image.
        texels_per_pixel: texels per side of that camera's smallest pixels.
        face_size_px: texels across the 90° of every face; None: as the image requires.
        subdivide: see `plan_tiles`.

    Raises:
        GraphicsError: the camera sees nothing.
    """
    past_rim = None
    if sensor.mesh_polygons is not None and isinstance(camera, HyperbolicCamera):
        mesh = tessellate(camera.mirror, sensor.mesh_polygons)
        # a fine mesh has many edges; only those on the rim extend past it
        middles_m = mesh.rim_middles_m if sensor.polygons == "auto" else mesh.edge_middles_m
        past_rim = middles_m @ MIRROR_FROM_OPTICAL
    return plan_tiles(
        camera,
        camera.rig_from_optical,
        texels_per_pixel,
        face_size_px=face_size_px,
        also_seen=past_rim,
        subdivide=subdivide,
        level_bias=ONE_SAMPLE_BIAS if sensor.supersampling == 1 else SUPERSAMPLED_BIAS,
    )


def plan_tiles(
    camera: CentralCamera,
    rig_from_optical: Floats,
    texels_per_pixel: float = 1.0,
    *,
    face_size_px: int | None = None,
    also_seen: Floats | None = None,
    subdivide: bool = False,
    level_bias: float = 0.0,
) -> TilePlan:
    """Plan the rectangle of each cube face that a camera sees.

    Without a face size, each face gets the texels that the densest part of the image on it needs,
    so that nothing is magnified except at an image's poles (`sampling_density`).

    Args:
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
    # edges and corners included: a small image from a long lens falls between a grid's samples
    u = np.linspace(-0.5, camera.width_px - 0.5, min(GRID, camera.width_px + 2))
    v = np.linspace(-0.5, camera.height_px - 0.5, min(GRID, camera.height_px + 2))
    rays = camera.ray_from_pixel(np.stack(np.meshgrid(u, v), axis=-1))
    seen = rays.directions[rays.valid]
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
        texels_per_pixel, face_size_px, subdivide, level_bias: see `plan_tiles`.
        max_level: highest mip level; None: as the densities require.
        gutter_px: minimum gutter around tiles.

    Raises:
        GraphicsError: no face is seen.
    """
    whole = [(face, region) for face, density in enumerate(densities) for region in density.whole()]
    if not whole:
        raise GraphicsError("camera: no pixel of the image sees anything of the scene")

    def plan(regions: list[tuple[int, RegionDensity]]) -> TilePlan:
        """One tile per region of a face."""
        sizes, minification = [], 0.0
        for _, region in regions:
            needed = math.ceil(2.0 * DENSITY_MARGIN * texels_per_pixel * region.max_px_per_tan)
            sizes.append(face_size_px or max(MIN_FACE_PX, needed))
            minification = max(minification, 0.5 * sizes[-1] / region.min_px_per_tan)
        level = round(math.log2(minification) + level_bias) if max_level is None else max_level
        level = max(0, min(level, int(math.log2(min(sizes)))))
        step = max(1 << level, gutter_px)
        tiles = [
            _tile(face, size, region.region, region.seen_region, step)
            for size, (face, region) in zip(sizes, regions, strict=True)
        ]
        return pack_tiles(tiles, level, level_bias)

    if not subdivide or face_size_px is not None:
        return plan(whole)
    texels = 0.0
    for _, region in whole:
        extent = region.seen_region[1] - region.seen_region[0]
        texels += float(np.prod(extent * texels_per_pixel * region.max_px_per_tan))
    tile_texels = max(TILE_TEXELS, TILE_SHARE * texels)
    parts = [
        (face, part)
        for face, density in enumerate(densities)
        for part in density.subdivide(texels_per_pixel, tile_texels)
    ]
    if not 0 < len(parts) <= MAX_TILES:
        return plan(whole)
    # a gutter is as wide as the largest mip texel: it may cost what cutting saves
    return min(plan(parts), plan(whole), key=lambda tile_plan: tile_plan.texels)


def whole_faces(plan: TilePlan) -> TilePlan:
    """Plan with each of the faces in a single padded tile, as dense as the face's densest tile."""
    sizes: dict[int, int] = {}
    for tile in plan.tiles:
        sizes[tile.face] = max(tile.face_size_px, sizes.get(tile.face, 0))
    return _whole_faces(sizes)


def cube_plan(face_size_px: int) -> TilePlan:
    """Plan with all six faces whole, without mip levels."""
    return _whole_faces(dict.fromkeys(range(len(FACE_NAMES)), face_size_px))


def _whole_faces(sizes_px: dict[int, int]) -> TilePlan:
    """Plan of whole faces by their sizes."""
    tiles = [_tile(face, size_px, WHOLE_FACE, WHOLE_FACE, 1) for face, size_px in sizes_px.items()]
    return pack_tiles(tiles, 0, 0.0)


def _tile(face: int, face_size_px: int, region: Floats, seen_region: Floats, step: int) -> Tile:
    """Tile around visible tangents (2, 2), without a position in the atlas.

    Tiles, and their faces, begin at multiples of `step`, and the gutter is one whole step: no mip
    texel mixes two tiles, and a lookup at the very edge of the visible region still finds a whole
    texel of its own face.
    """
    texels = 0.5 * face_size_px * (np.clip(seen_region, -1.0, 1.0) + 1.0) / step
    first = step * (np.floor(texels[0]).astype(int) - 1)
    last = step * (np.ceil(texels[1]).astype(int) + 1)
    (left, top), (width, height) = first.tolist(), (last - first).tolist()
    (x, y), (last_x, last_y) = region.tolist()
    return Tile(face, face_size_px, (left, top), (width, height), ((x, y), (last_x, last_y)))


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


_MIN_LENGTH = 1e-30  # of a normal: an infinitely far plane has a normal of 0


class PosedViews(NamedTuple):
    """Views of all tiles in one frame, in the viewpoint frame."""

    tiles: tuple[Tile, ...]
    clips_from_viewpoint: Floats  # (tiles, 4, 4) projections from the viewpoint frame to clip space
    # (tiles, 6, 4), inward unit normals and distances of left, right, top, bottom, near and far.
    # A point is inside if n · (x, y, z) + d ≥ 0
    frustum_planes: Floats

    def cull(self, centers_m: Floats, radii_m: Floats) -> Bools:
        """Mask (tiles, n) of spheres (n, 3) and (n,) that are not outside of a tile's frustum."""
        inside_m = self.frustum_planes[..., :3] @ centers_m.T + self.frustum_planes[..., 3:]
        return np.all(inside_m + radii_m >= 0.0, axis=1)


class TileViews:
    """Projections of all tiles of a plan; `near_m`, `far_m`: clip planes of the virtual cameras."""

    def __init__(self, plan: TilePlan, near_m: float, far_m: float):
        self._tiles = plan.tiles
        self._faces_from_rig = FACE_FROM_RIG[[tile.face for tile in plan.tiles]]
        self._clips_from_face = np.stack([_projection(tile, near_m, far_m) for tile in plan.tiles])
        self._planes_in_rig = frustum_planes(clips_from_rig(plan, near_m, far_m))

    def at(self, world_from_rig: Floats) -> PosedViews:
        """Views from a pose (4, 4)."""
        rig_from_viewpoint = world_from_rig[:3, :3].T
        clips, planes = self._clips_from_face.copy(), self._planes_in_rig.copy()
        clips[..., :3] = clips[..., :3] @ (self._faces_from_rig @ rig_from_viewpoint)
        planes[..., :3] = planes[..., :3] @ rig_from_viewpoint
        return PosedViews(self._tiles, clips, planes)


def frustum_planes(clips: Floats) -> Floats:
    """Frustum planes (n, 6, 4), see `PosedViews`, of matrices (n, 4, 4) to clip space."""
    x, y, z, w = np.moveaxis(clips, 1, 0)
    planes: Floats = np.stack((w + x, w - x, w + y, w - y, w - z, z), axis=1)
    lengths = np.linalg.norm(planes[..., :3], axis=-1, keepdims=True)
    planes /= np.maximum(lengths, _MIN_LENGTH)
    return planes


def clips_from_rig(plan: TilePlan, near_m: float, far_m: float) -> Floats:
    """Matrices (tiles, 4, 4) from rig axes at the viewpoint to each tile's clip space."""
    clips = np.stack([_projection(tile, near_m, far_m) for tile in plan.tiles])
    clips[..., :3] = clips[..., :3] @ FACE_FROM_RIG[[tile.face for tile in plan.tiles]]
    return clips


def _projection(tile: Tile, near_m: float, far_m: float) -> Floats:
    """Matrix (4, 4) clip_from_face of a tile; clip-space y points down the image.

    Depth is 1 at the near plane and 0 at the far plane, which may be infinite.
    """
    first, last = tile.padded_region
    clip_from_face = np.zeros((4, 4))
    clip_from_face[[0, 1], [0, 1]] = 2.0 / (last - first)
    clip_from_face[:2, 2] = -(last + first) / (last - first)
    if math.isinf(far_m):
        clip_from_face[2, 3] = near_m
    else:
        clip_from_face[2, 2:] = np.array((-near_m, far_m * near_m)) / (far_m - near_m)
    clip_from_face[3, 2] = 1.0
    return clip_from_face
