"""Which faces of the cube a camera needs, and how many texels each."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera
from omnisim.cube import (
    FACE_FROM_RIG,
    FACE_NAMES,
    LAYOUT_CELLS,
    LAYOUT_COLUMNS,
    LAYOUT_ROWS,
    face_index,
    face_tangents,
)
from omnisim.errors import GraphicsError

# Samples along a face's edge, corners included: a rim reaches a face first at the middle of an
# edge or at a corner.
GRID = 65
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
    """One virtual camera: 90° of the scene, drawn with a margin, and its place in the atlas.

    Attributes:
        index: into `omnisim.cube.FACE_NAMES`.
        size_px: texels across the 90°.
        margin_px: texels drawn before the 90° begin, at the left and at the top.
        tile_px: texels of the whole tile, margins included.
        left_px, top_px: the tile's place in the atlas.
    """

    index: int
    size_px: int
    margin_px: int
    tile_px: int
    left_px: int = 0
    top_px: int = 0

    @property
    def name(self) -> str:
        """Name of the face."""
        return FACE_NAMES[self.index]

    @property
    def tangents(self) -> tuple[float, float]:
        """Tangents of the tile's left (or top) and right (or bottom) edge."""
        before = self.margin_px
        after = self.tile_px - self.size_px - self.margin_px
        return -1.0 - 2.0 * before / self.size_px, 1.0 + 2.0 * after / self.size_px


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


def plan_faces(
    camera: CentralCamera, rig_from_optical: NDArray[np.float64], face_size_px: int | None = None
) -> FacePlan:
    """Plan the faces that a camera sees.

    Without a size each face gets as many texels as the finest part of the picture that looks at
    it has pixels, so that nothing is magnified, but for the poles of a picture (MOST_STRETCH).

    Raises:
        GraphicsError: the camera sees nothing at all.
    """
    directions_rig = _picture_rays(camera) @ rig_from_optical.T
    face_of_ray = face_index(directions_rig)
    densities = {}
    for index in range(len(FACE_NAMES)):
        tangents = face_tangents(directions_rig[face_of_ray == index], index)
        tangents = np.concatenate((_grid(), tangents))
        density = _pixels_per_tangent(camera, FACE_FROM_RIG[index] @ rig_from_optical, tangents)
        if density is not None:
            densities[index] = density
    if not densities:
        raise GraphicsError("camera: no pixel of the picture sees anything of the scene")
    sizes = {
        index: max(MIN_FACE_PX, math.ceil(2.0 * SPARE * finest))
        if face_size_px is None
        else face_size_px
        for index, (_, finest) in densities.items()
    }
    coarsest = max(0.5 * sizes[index] / least for index, (least, _) in densities.items())
    level = max(0, min(math.ceil(math.log2(coarsest)), int(math.log2(min(sizes.values())))))
    # Tiles begin, and the 90° in them, at multiples of 2^level: no mip texel mixes two tiles, and
    # a lookup at the very edge of the 90° still finds a whole texel of its own face.
    step = 1 << level
    tiles = {
        index: Face(index, size, step, step * math.ceil((size + 2 * step) / step))
        for index, size in sizes.items()
    }
    return _placed(tiles, level)


def _placed(tiles: dict[int, Face], level: int) -> FacePlan:
    """Put the tiles into the layout of the unfolded cube, each row and column as wide as needed."""
    columns, rows = [0] * LAYOUT_COLUMNS, [0] * LAYOUT_ROWS
    for index, face in tiles.items():
        column, row = LAYOUT_CELLS[index]
        columns[column] = max(columns[column], face.tile_px)
        rows[row] = max(rows[row], face.tile_px)
    faces = []
    for index, face in tiles.items():
        column, row = LAYOUT_CELLS[index]
        left_px, top_px = sum(columns[:column]), sum(rows[:row])
        faces.append(replace(face, left_px=left_px, top_px=top_px))
    return FacePlan(tuple(faces), level, sum(columns), sum(rows))


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


def _pixels_per_tangent(
    camera: CentralCamera, face_from_optical: NDArray[np.float64], tangents: NDArray[np.float64]
) -> tuple[float, float] | None:
    """Least and most pixels to a tangent of 1 over those samples (n, 2) that the picture shows."""

    def pixels(right: float, down: float) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        local = np.ones((len(tangents), 3))
        local[:, :2] = tangents + np.array([right, down])
        return camera.pixel_from_ray(local @ face_from_optical)

    here, seen = pixels(0.0, 0.0)
    in_picture = np.all((here >= -1.0) & (here <= (camera.width_px, camera.height_px)), axis=-1)
    seen = seen & in_picture
    if not seen.any():
        return None
    right, right_seen = pixels(_STEP, 0.0)
    down, down_seen = pixels(0.0, _STEP)
    steps = np.stack((right - here, down - here), axis=-1)
    inner = seen & right_seen & down_seen
    # A picture of everything is cut open somewhere, and at its poles all azimuths meet: there a
    # step leaps. No face is so fine that one would move the picture by a pixel otherwise.
    smooth = inner & np.all(np.abs(steps) < 1.0, axis=(-2, -1))
    inner = smooth if smooth.any() else inner
    if not inner.any():
        return 1.0, 0.5 * MIN_FACE_PX
    stretches = np.linalg.svd(steps[inner] / _STEP, compute_uv=False)
    finest = float(np.minimum(stretches[:, 0], MOST_STRETCH * stretches[:, 1]).max())
    return max(float(stretches[:, 1].min()), COARSEST_SHARE * finest, 1e-6), finest
