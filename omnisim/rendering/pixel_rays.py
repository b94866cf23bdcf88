"""Rays of a camera's samples, in bands of rows, in its optical frame; no scene is needed."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from omnisim.cameras import (
    CentralCamera,
    HyperbolicCamera,
    NonCentralCamera,
    pixel_grid,
    pixels_of_points,
)
from omnisim.cameras import Rays as CameraRays
from omnisim.cameras.mirrors import tessellate
from omnisim.cameras.mirrors.hyperbolic import mesh_rays
from omnisim.core.arrays import AnyFloats, Bools, Floats, Floats32, Uints32

# Approximate number of samples per band: intermediate arrays stay in the cache, and threads have
# enough work between Python's own steps.
_SAMPLES_PER_BAND = 1 << 14
_MAX_KEPT_SAMPLES = 1 << 22  # 200 MB; rays of larger images are recomputed for each image


class Band(NamedTuple):
    """Rays of some rows of samples: the valid ones, row by row."""

    rows: slice
    valid: Bools  # (rows, width)
    directions: Floats  # (n, 3), unit, optical frame
    origins_m: Floats | None  # (n, 3), optical frame; None: at the viewpoint
    footprints: Floats32  # (n, 2, 3) steps to the next sample to the right and below, optical


class PixelRays:
    """Rays of an image of samples.

    Args:
        camera: camera with samples as its pixels.
        polygons: number of polygons of the mirror mesh; None: exact, by the camera model.
        rows_per_pixel: samples per pixel side; bands end at pixel boundaries.

    Attributes:
        bands: rows of each band.
    """

    def __init__(self, camera: CentralCamera, polygons: int | None, rows_per_pixel: int = 1):
        self.camera = camera
        self._ray_from_pixel: Callable[[Floats], CameraRays] = camera.ray_from_pixel
        if polygons is not None and isinstance(camera, HyperbolicCamera):
            self._ray_from_pixel = partial(mesh_rays, camera, tessellate(camera.mirror, polygons))
        elif polygons is not None and isinstance(camera, NonCentralCamera):
            from omnisim.cameras.optics.mesh_rays import MeshRays  # few cameras need it

            self._ray_from_pixel = MeshRays(camera, polygons).ray_from_pixel
        pixels_per_band = max(1, _SAMPLES_PER_BAND // (camera.width_px * rows_per_pixel))
        step = pixels_per_band * rows_per_pixel
        self.bands = tuple(
            slice(first, min(first + step, camera.height_px))
            for first in range(0, camera.height_px, step)
        )
        self._keeps = camera.width_px * camera.height_px <= _MAX_KEPT_SAMPLES
        self._kept: dict[int, Band] = {}

    def band(self, number: int) -> Band:
        """One of `bands`: computed on first use, and kept if all of them fit in memory."""
        band = self._kept.get(number) or self._compute(number)
        if self._keeps:
            self._kept[number] = band
        return band

    def _compute(self, number: int) -> Band:
        rows, camera = self.bands[number], self.camera
        # one extra row and column at either end, for the footprints
        height = rows.stop - rows.start
        pixels = pixel_grid(camera.width_px + 2, height + 2) + (-1.0, rows.start - 1.0)
        rays = self._ray_from_pixel(pixels)
        valid = rays.valid[1:-1, 1:-1]
        directions = np.where(rays.valid[..., None], rays.directions, 0.0)
        footprints = np.stack(
            [_steps(directions, rays.valid, axis)[1:-1, 1:-1][valid] for axis in (1, 0)], axis=1
        )
        origins_m = None if rays.origins_m is None else rays.origins_m[1:-1, 1:-1][valid]
        inside = directions[1:-1, 1:-1][valid]
        return Band(rows, valid, inside, origins_m, footprints.astype(np.float32))


def _steps(directions: Floats, valid: Bools, axis: int) -> Floats:
    """Steps (height, width, 3) from each direction to its neighbor along an axis.

    The step to the next direction, else from the previous one; 0 without a valid neighbor.
    """
    ahead = np.roll(directions, -1, axis) - directions
    has_next, has_last = np.roll(valid, -1, axis), np.roll(valid, 1, axis)
    back = np.roll(ahead, 1, axis)
    return np.where(has_next[..., None], ahead, np.where(has_last[..., None], back, 0.0))


def moved_points(points_m: AnyFloats, draw_ids: Uints32, other_from_current: Floats) -> Floats:
    """Points (n, 3) of hits moved to another viewpoint frame by (draws, 3, 4); directions stay."""
    moved_m, hit = points_m.astype(np.float64), np.flatnonzero(draw_ids)
    moves = other_from_current[draw_ids[hit] - 1]
    moved_m[hit] = np.einsum("nij,nj->ni", moves[..., :3], moved_m[hit]) + moves[..., 3]
    return moved_m


def starts_of_rays(
    camera: CentralCamera, points_m: Floats, is_finite: Bools, world_from_rig: Floats
) -> Floats:
    """Origins (n, 3), viewpoint frame, of the camera rays through its points (n, 3)."""
    if not isinstance(camera, NonCentralCamera):
        return np.zeros((1, 3)).repeat(len(points_m), axis=0)
    world_from_optical = world_from_rig[:3, :3] @ camera.rig_from_optical
    optical_m = np.einsum("nj,ji->ni", points_m, world_from_optical)
    rays = camera.ray_from_pixel(pixels_of_points(camera, optical_m, is_finite).positions_px)
    assert rays.origins_m is not None
    return np.einsum("nj,ij->ni", rays.origins_m, world_from_optical)
