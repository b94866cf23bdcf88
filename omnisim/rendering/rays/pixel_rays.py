"""Rays of a camera's samples, in bands of rows, and images by them."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from omnisim.cameras import CentralCamera, HyperbolicCamera, NonCentralCamera, pixel_grid
from omnisim.cameras import Rays as CameraRays
from omnisim.cameras.mirrors import tessellate
from omnisim.cameras.mirrors.mirror_mesh_rays import mesh_rays
from omnisim.core.arrays import Bools, Floats, Floats32
from omnisim.core.world import Pose
from omnisim.rendering.rays.caster import DepthLimits, Rays
from omnisim.rendering.rays.ray_scene import ObjectState, RayScene
from omnisim.rendering.rays.shading.reflections import Paths

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
    footprints: Floats32  # (n, 2, 3): steps to the next sample to the right and below

    def aim(self, limits: DepthLimits, rig_from_optical: Floats, world_from_rig: Pose) -> Rays:
        """Rays (n,) in the world, from a camera orientation (3, 3) in the rig and a pose (4, 4)."""
        rig = np.einsum("nj,ij->ni", self.directions, rig_from_optical)
        rays = limits.aim(rig, world_from_rig)
        if self.origins_m is None:
            return rays
        world_from_optical = world_from_rig[:3, :3] @ rig_from_optical
        offsets_m = np.einsum("nj,ij->ni", self.origins_m, world_from_optical)
        return rays._replace(origins_m=rays.origins_m + offsets_m)

    def world_footprints(self, world_from_optical: Floats) -> Floats32:
        """Footprints (n, 2, 3) in the world, by the camera's rotation (3, 3)."""
        rotation = world_from_optical.astype(np.float32)
        return np.einsum("nsj,ij->nsi", self.footprints, rotation)


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
            from omnisim.cameras.optics.mesh_rays import (
                MeshRays,
            )  # imported late: few cameras need it

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


class RayImage:
    """Image of an ideal camera, of `supersampling`² samples per pixel; constants are made once."""

    def __init__(
        self,
        scene: RayScene,
        samples: CentralCamera,
        polygons: int | None,
        supersampling: int,
        limits: DepthLimits,
        unlit: bool = False,
    ):
        self._scene, self._limits, self._unlit = scene, limits, unlit
        self._supersampling = supersampling
        self._rays = PixelRays(samples, polygons, supersampling)

    def render(self, world_from_rig: Floats, objects: ObjectState, key: int = 0) -> Floats32:
        """Render the image (height, width, 4) from a pose (4, 4): linear RGB, and validity.

        A pixel is valid if at least half of its samples are. The key is that of the random numbers
        of glossy reflections.
        """

        def rows_of(number: int) -> Floats32:
            band = self._rays.band(number)
            return self._average(self._sampled(band, world_from_rig, objects, key))

        return np.concatenate(self._scene.in_threads(rows_of, range(len(self._rays.bands))))

    def _sampled(
        self, band: Band, world_from_rig: Floats, objects: ObjectState, key: int
    ) -> Floats32:
        """Samples (rows, width, 4) of a band: linear RGB, and validity."""
        camera = self._rays.camera
        rays = band.aim(self._limits, camera.rig_from_optical, world_from_rig)
        world_from_optical = world_from_rig[:3, :3] @ camera.rig_from_optical
        footprints = band.world_footprints(world_from_optical)
        # pixels of the samples, and the samples' numbers in them
        rows, columns = np.nonzero(band.valid)
        rows, side = rows + band.rows.start, self._supersampling
        pixels = rows // side * (camera.width_px // side + 1) + columns // side
        numbers = (rows % side * side + columns % side).astype(np.uint32)
        ones = np.ones(len(rows), dtype=np.float32)
        paths = Paths(pixels.astype(np.uint32), numbers, ones, key)
        samples = np.zeros((*band.valid.shape, 4), dtype=np.float32)
        samples[band.valid, :3] = self._scene.radiance(
            rays, footprints, objects, self._unlit, paths
        )
        samples[band.valid, 3] = 1.0
        return samples

    def _average(self, samples: Floats32) -> Floats32:
        """Pixels (height, width, 4): averages of the samples that cover them."""
        side = self._supersampling
        height, width = (size // side for size in samples.shape[:2])
        covering = samples[: height * side, : width * side].reshape(height, side, width, side, 4)
        total: Floats32 = covering.sum(axis=(1, 3))
        counts = total[..., 3]
        valid = 2.0 * counts >= side * side
        pixels = np.zeros_like(total)
        pixels[valid, :3] = total[valid, :3] / counts[valid, None]
        pixels[valid, 3] = 1.0
        return pixels
