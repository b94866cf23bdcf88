"""Which faces of the cube a camera needs, which part of each, and how many texels."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

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

# Samples along a face's edge, corners included: a rim reaches a face first at the middle of an
# edge or at a corner.
GRID = 65
GRID_STEP = 2.0 / (GRID - 1)
# The finest place lies between two samples at worst: 1 % to spare.
SPARE = 1.01
MIN_FACE_PX = 16
# A pole of the picture stretches one direction without bound, the rim of an orthographic lens
# squeezes one to nothing. Neither is followed further than this: what the picture stretches
# across more than four times as much as along is drawn for four, and no pixel is taken to be
# wider than 32 of the finest.
MOST_STRETCH = 4.0
COARSEST_SHARE = 1.0 / 32.0
_STEP = 1e-5  # of a tangent, for derivatives: far above rounding, far below a texel


@dataclass(frozen=True)
class Face:
    """One virtual camera: what the picture needs of a face of the cube, and its tile in the atlas.

    Attributes:
        index: into `omnisim.cube.FACE_NAMES`.
        size_px: texels across the 90° of the whole face.
        first_px: the tile's first texel (right, down), counted from the face's top left corner;
            negative where it begins before the 90° do.
        tile_px: width and height of the tile, margins included.
        left_px, top_px: the tile's place in the atlas.
    """

    index: int
    size_px: int
    first_px: tuple[int, int]
    tile_px: tuple[int, int]
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
class FacePlan:
    """All virtual cameras and the atlas that they are drawn into.

    Attributes:
        faces: the faces that the camera needs.
        max_level: mip levels beyond the first that lookups reach.
        width_px, height_px: size of the atlas.
    """

    faces: tuple[Face, ...]
    max_level: int
    width_px: int
    height_px: int


class _Need(NamedTuple):
    """What the picture needs of a face."""

    coarsest: float  # least pixels to a tangent of 1
    finest: float  # most
    window: NDArray[np.float64]  # (2, 2): least and largest tangents, right and down


def plan_faces(
    camera: CentralCamera,
    rig_from_optical: NDArray[np.float64],
    face_size_px: int | None = None,
    also_seen: NDArray[np.float64] | None = None,
) -> FacePlan:
    """Plan the faces that a camera sees, and of each the rectangle that it sees.

    Without a size each face gets as many texels as the finest part of the picture that looks at
    it has pixels, so that nothing is magnified, but for the poles of a picture (MOST_STRETCH).

    Args:
        camera: whose picture.
        rig_from_optical: (3, 3).
        face_size_px: texels across the 90° of every face.
        also_seen: directions (n, 3), optical frame, that are looked up although the camera model
            does not see them: a mesh's rim has corners.

    Raises:
        GraphicsError: the camera sees nothing at all.
    """
    seen = _picture_rays(camera)
    if also_seen is not None:
        seen = np.concatenate((seen, also_seen))
    directions_rig = seen @ rig_from_optical.T
    face_of_ray = face_index(directions_rig)
    needs = {}
    for index in range(len(FACE_NAMES)):
        tangents = face_tangents(directions_rig[face_of_ray == index], index)
        need = _need(camera, FACE_FROM_RIG[index] @ rig_from_optical, tangents)
        if need is not None:
            needs[index] = need
    if not needs:
        raise GraphicsError("camera: no pixel of the picture sees anything of the scene")
    sizes = {
        index: max(MIN_FACE_PX, math.ceil(2.0 * SPARE * need.finest))
        if face_size_px is None
        else face_size_px
        for index, need in needs.items()
    }
    coarsest = max(0.5 * sizes[index] / need.coarsest for index, need in needs.items())
    level = max(0, min(math.ceil(math.log2(coarsest)), int(math.log2(min(sizes.values())))))
    step = 1 << level
    return _placed([_tile(i, sizes[i], need.window, step) for i, need in needs.items()], level)


def whole_faces(plan: FacePlan) -> FacePlan:
    """The same faces, drawn to their edges all around: what a person looks at."""
    step = 1 << plan.max_level
    everything = np.array([[-1.0, -1.0], [1.0, 1.0]])
    tiles = [_tile(face.index, face.size_px, everything, step) for face in plan.faces]
    return _placed(tiles, plan.max_level)


def _tile(index: int, size_px: int, window: NDArray[np.float64], step: int) -> Face:
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
    return Face(index, size_px, (left, top), (width, height))


def _placed(tiles: list[Face], level: int) -> FacePlan:
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
    faces.sort(key=lambda face: face.index)
    return FacePlan(tuple(faces), level, used_px, top_px + row_px)


def _picture_rays(camera: CentralCamera) -> NDArray[np.float64]:
    """Directions (n, 3), optical frame, that the picture sees, its edges and corners included.

    A small picture by a long lens falls between the samples of a face's grid.
    """
    u = np.linspace(-0.5, camera.width_px - 0.5, min(GRID, camera.width_px + 2))
    v = np.linspace(-0.5, camera.height_px - 0.5, min(GRID, camera.height_px + 2))
    rays = camera.ray_from_pixel(np.stack(np.meshgrid(u, v), axis=-1))
    return rays.directions[rays.valid]


def _grid() -> NDArray[np.float64]:
    """Tangents (n, 2) all over a face, its edges and corners included."""
    line = np.linspace(-1.0, 1.0, GRID)
    return np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)


def _need(
    camera: CentralCamera, face_from_optical: NDArray[np.float64], looked_up: NDArray[np.float64]
) -> _Need | None:
    """What the picture needs of a face, by samples all over it and tangents (n, 2) looked up."""
    tangents = np.concatenate((_grid(), looked_up))

    def pixels(right: float, down: float) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        local = np.ones((len(tangents), 3))
        local[:, :2] = tangents + np.array([right, down])
        return camera.pixel_from_ray(local @ face_from_optical)

    here, seen = pixels(0.0, 0.0)
    in_picture = np.all((here >= -1.0) & (here <= (camera.width_px, camera.height_px)), axis=-1)
    seen = seen & in_picture
    if not seen.any():
        return None
    shown = np.concatenate((tangents[seen], looked_up))
    # what is seen may begin anywhere between two samples
    window = np.stack((shown.min(axis=0) - GRID_STEP, shown.max(axis=0) + GRID_STEP))
    right, right_seen = pixels(_STEP, 0.0)
    down, down_seen = pixels(0.0, _STEP)
    steps = np.stack((right - here, down - here), axis=-1)
    inner = seen & right_seen & down_seen
    # A picture of everything is cut open somewhere, and at its poles all azimuths meet: there a
    # step leaps. No face is so fine that one would move the picture by a pixel otherwise.
    smooth = inner & np.all(np.abs(steps) < 1.0, axis=(-2, -1))
    inner = smooth if smooth.any() else inner
    if not inner.any():
        return _Need(1.0, 0.5 * MIN_FACE_PX, window)
    stretches = np.linalg.svd(steps[inner] / _STEP, compute_uv=False)
    finest = float(np.minimum(stretches[:, 0], MOST_STRETCH * stretches[:, 1]).max())
    coarsest = max(float(stretches[:, 1].min()), COARSEST_SHARE * finest, 1e-6)
    return _Need(coarsest, finest, window)
