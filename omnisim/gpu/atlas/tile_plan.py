"""Which faces of the cube a camera needs, which parts of each, and how many texels."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera
from omnisim.cube import (
    FACE_FROM_RIG,
    FACE_NAMES,
    face_index,
    face_tangents,
)
from omnisim.errors import GraphicsError
from omnisim.gpu.atlas.sampling_density import GRID, Need, SamplingDensity

# The finest place lies between two samples at worst: 1 % to spare.
SPARE = 1.01
MIN_FACE_PX = 16
MOST_TILES = 64
# What one more tile costs: triangles at its edge are drawn once more. In texels, and as a share of
# all texels, so that tiles stay few in a large picture.
TILE_TEXELS = 8000.0
TILE_SHARE = 0.005
WHOLE = ((-1.0, -1.0), (1.0, 1.0))


@dataclass(frozen=True)
class Face:
    """One virtual camera: what the picture needs of a face of the cube, and its tile in the atlas.

    Attributes:
        index: into `omnisim.cube.FACE_NAMES`.
        size_px: texels across the 90° of the whole face.
        first_px: the tile's first texel (right, down), counted from the face's top left corner;
            negative where it begins before the 90° do.
        tile_px: width and height of the tile, margins included.
        core: tangents that are looked up in this tile and in no other: the first two (right, down),
            the last two.
        left_px, top_px: the tile's place in the atlas.
    """

    index: int
    size_px: int
    first_px: tuple[int, int]
    tile_px: tuple[int, int]
    core: tuple[tuple[float, float], tuple[float, float]] = WHOLE
    left_px: int = 0
    top_px: int = 0

    @property
    def name(self) -> str:
        """Name of the face."""
        return FACE_NAMES[self.index]

    @property
    def corner_px(self) -> tuple[int, int]:
        """Where in the atlas the face's top left corner is, or would be: left, top."""
        return self.left_px - self.first_px[0], self.top_px - self.first_px[1]

    @property
    def tangents(self) -> NDArray[np.float64]:
        """Tangents (2, 2) of the tile's left and top, and of its right and bottom edge."""
        first = np.array(self.first_px, dtype=np.float64)
        return -1.0 + 2.0 * np.stack((first, first + self.tile_px)) / self.size_px


@dataclass(frozen=True)
class TilePlan:
    """All virtual cameras and the atlas that they are drawn into.

    Attributes:
        faces: the faces that the camera needs, or the parts of them, by face.
        max_level: mip levels beyond the first that lookups reach.
        level_bias: added to the level at which a texel is as wide as what looks it up.
        width_px, height_px: size of the atlas.
    """

    faces: tuple[Face, ...]
    max_level: int
    level_bias: float
    width_px: int
    height_px: int

    @property
    def texels(self) -> int:
        """How many texels are drawn: those of all tiles."""
        return sum(face.tile_px[0] * face.tile_px[1] for face in self.faces)


def plan_tiles(
    camera: CentralCamera,
    rig_from_optical: NDArray[np.float64],
    texels_per_pixel: float = 1.0,
    *,
    face_size_px: int | None = None,
    also_seen: NDArray[np.float64] | None = None,
    in_parts: bool = False,
    level_bias: float = 0.0,
) -> TilePlan:
    """Plan the faces that a camera sees, and of each the rectangle that it sees.

    Without a size each face gets as many texels as the finest part of the picture that looks at
    it needs, so that nothing is magnified, but for the poles of a picture (`face_need`).

    Args:
        camera: whose picture.
        rig_from_optical: (3, 3).
        texels_per_pixel: to a side of the picture's finest pixels.
        face_size_px: texels across the 90° of every face.
        also_seen: directions (n, 3), optical frame, that are looked up although the camera model
            does not see them: a mesh's rim has corners.
        in_parts: cut faces into tiles of different fineness where that spares texels.
        level_bias: added to the mip level at which a texel is as wide as a pixel: negative is
            sharper. Lookups are bilinear, so that two texels apart, at −1, they leave nothing out.

    Raises:
        GraphicsError: the camera sees nothing at all.
    """
    seen = _picture_rays(camera)
    if also_seen is not None:
        seen = np.concatenate((seen, also_seen))
    directions_rig = seen @ rig_from_optical.T
    face_of_ray = face_index(directions_rig)
    of_faces = [
        SamplingDensity(
            camera,
            FACE_FROM_RIG[index] @ rig_from_optical,
            face_tangents(directions_rig[face_of_ray == index], index),
        )
        for index in range(len(FACE_NAMES))
    ]
    parts: list[tuple[int, Need]] = []
    needs = [(i, whole) for i, face in enumerate(of_faces) if (whole := face.whole()) is not None]
    if in_parts and face_size_px is None:
        texels = sum(_texels(need, texels_per_pixel) for _, need in needs)
        tile_texels = max(TILE_TEXELS, TILE_SHARE * texels)
        parts = [
            (index, part)
            for index, face in enumerate(of_faces)
            for part in face.parts(texels_per_pixel, tile_texels)
        ]
    if not needs:
        raise GraphicsError("camera: no pixel of the picture sees anything of the scene")
    plan = _planned(needs, texels_per_pixel, face_size_px, level_bias)
    if 0 < len(parts) <= MOST_TILES:
        # a tile's margins are as wide as the coarsest mip texel: they may cost what cutting spares
        cut = _planned(parts, texels_per_pixel, face_size_px, level_bias)
        plan = min(cut, plan, key=lambda one: one.texels)
    return plan


def _planned(
    needs: list[tuple[int, Need]],
    texels_per_pixel: float,
    face_size_px: int | None,
    level_bias: float,
) -> TilePlan:
    """A tile for each need of a face, by the face's index."""
    sizes = [
        max(MIN_FACE_PX, math.ceil(2.0 * SPARE * texels_per_pixel * need.finest))
        if face_size_px is None
        else face_size_px
        for _, need in needs
    ]
    coarsest = max(0.5 * size / need.coarsest for size, (_, need) in zip(sizes, needs, strict=True))
    level = round(math.log2(coarsest) + level_bias)
    level = max(0, min(level, int(math.log2(min(sizes)))))
    tiles = [
        _tile(index, size, need.window, 1 << level, need.core)
        for size, (index, need) in zip(sizes, needs, strict=True)
    ]
    return _placed(tiles, level, level_bias)


def whole_faces(plan: TilePlan) -> TilePlan:
    """The same faces, each in one piece and drawn to its edges all around: what a person looks
    at. Each is as fine as its finest part."""  # fmt: skip
    sizes: dict[int, int] = {}
    for face in plan.faces:
        sizes[face.index] = max(face.size_px, sizes.get(face.index, 0))
    everything = np.array(WHOLE)
    return _placed([_tile(index, size, everything, 1) for index, size in sizes.items()], 0, 0.0)


def _texels(need: Need, texels_per_pixel: float) -> float:
    """About how many texels a tile takes."""
    return float(np.prod((need.window[1] - need.window[0]) * texels_per_pixel * need.finest))


def _tile(
    index: int,
    size_px: int,
    window: NDArray[np.float64],
    step: int,
    core: NDArray[np.float64] | None = None,
) -> Face:
    """The tile around a window of tangents (2, 2), not yet placed.

    Tiles, and the faces in them, begin at multiples of `step`, and a whole one is spared around
    the window: no mip texel mixes two tiles, and a lookup at the very edge of the window still
    finds a whole texel of its own face.
    """
    texels = 0.5 * size_px * (np.clip(window, -1.0, 1.0) + 1.0) / step
    first = step * (np.floor(texels[0]).astype(int) - 1)
    last = step * (np.ceil(texels[1]).astype(int) + 1)
    left, top = first.tolist()
    width, height = (last - first).tolist()
    (first_right, first_down), (last_right, last_down) = WHOLE if core is None else core.tolist()
    core_of_tile = ((first_right, first_down), (last_right, last_down))
    return Face(index, size_px, (left, top), (width, height), core_of_tile)


def _placed(tiles: list[Face], level: int, level_bias: float) -> TilePlan:
    """Put the tiles into rows, the high ones first, in an atlas about as wide as high."""
    widest = max(tile.tile_px[0] for tile in tiles)
    texels = sum(tile.tile_px[0] * tile.tile_px[1] for tile in tiles)
    width_px = max(widest, 1 << math.ceil(math.log2(math.sqrt(texels))))
    faces: list[Face] = []
    left_px = top_px = row_px = 0
    for tile in sorted(tiles, key=lambda tile: -tile.tile_px[1]):
        if left_px + tile.tile_px[0] > width_px:
            left_px, top_px, row_px = 0, top_px + row_px, 0
        faces.append(replace(tile, left_px=left_px, top_px=top_px))
        left_px += tile.tile_px[0]
        row_px = max(row_px, tile.tile_px[1])
    used_px = max(face.left_px + face.tile_px[0] for face in faces)
    faces.sort(key=lambda face: (face.index, face.core))
    return TilePlan(tuple(faces), level, level_bias, used_px, top_px + row_px)


def _picture_rays(camera: CentralCamera) -> NDArray[np.float64]:
    """Directions (n, 3), optical frame, that the picture sees, its edges and corners included.

    A small picture by a long lens falls between the samples of a face's grid.
    """
    u = np.linspace(-0.5, camera.width_px - 0.5, min(GRID, camera.width_px + 2))
    v = np.linspace(-0.5, camera.height_px - 0.5, min(GRID, camera.height_px + 2))
    rays = camera.ray_from_pixel(np.stack(np.meshgrid(u, v), axis=-1))
    return rays.directions[rays.valid]
