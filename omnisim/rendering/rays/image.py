"""Images by ray casting: a camera's samples, averaged over its pixels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera
from omnisim.rendering.rays.depth_limits import DepthLimits
from omnisim.rendering.rays.pixel_rays import Band, PixelRays
from omnisim.rendering.rays.ray_scene import ObjectState, RayScene
from omnisim.rendering.rays.shading.reflections import Paths


class RayImage:
    """Image of an ideal camera; constant data is computed once.

    Args:
        scene: scene to cast at.
        samples: camera whose pixels are the samples.
        polygons: number of polygons of the mirror mesh; None: exact mirror.
        supersampling: samples per pixel side, averaged in linear light.
        limits: depth limits of the rays.
        unlit: render plain base colors.
    """

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

    def render(
        self, world_from_rig: NDArray[np.float64], objects: ObjectState, key: int = 0
    ) -> NDArray[np.float32]:
        """Render the image (height, width, 4) from a pose (4, 4): linear RGB, and validity.

        A pixel is valid if at least half of its samples are. The key is that of the random numbers
        of glossy reflections.
        """

        def rows_of(number: int) -> NDArray[np.float32]:
            band = self._rays.band(number)
            return self._average(self._sampled(band, world_from_rig, objects, key))

        return np.concatenate(self._scene.in_threads(rows_of, range(len(self._rays.bands))))

    def _sampled(
        self, band: Band, world_from_rig: NDArray[np.float64], objects: ObjectState, key: int
    ) -> NDArray[np.float32]:
        """Samples (rows, width, 4) of a band: linear RGB, and validity."""
        camera = self._rays.camera
        rays = band.aim(self._limits, camera.rig_from_optical, world_from_rig)
        world_from_optical = world_from_rig[:3, :3] @ camera.rig_from_optical
        footprints = band.world_footprints(world_from_optical)
        samples = np.zeros((*band.valid.shape, 4), dtype=np.float32)
        samples[band.valid, :3] = self._scene.radiance(
            rays, footprints, objects, self._unlit, self._paths(band, key)
        )
        samples[band.valid, 3] = 1.0
        return samples

    def _paths(self, band: Band, key: int) -> Paths:
        """Pixels of a band's samples, and the samples' numbers in them."""
        rows, columns = np.nonzero(band.valid)
        rows, side = rows + band.rows.start, self._supersampling
        pixels = rows // side * (self._rays.camera.width_px // side + 1) + columns // side
        numbers = rows % side * side + columns % side
        ones = np.ones(len(rows), dtype=np.float32)
        return Paths(pixels.astype(np.uint32), numbers.astype(np.uint32), ones, key)

    def _average(self, samples: NDArray[np.float32]) -> NDArray[np.float32]:
        """Pixels (height, width, 4): averages of the samples that cover them."""
        side = self._supersampling
        height, width = (size // side for size in samples.shape[:2])
        covering = samples[: height * side, : width * side].reshape(height, side, width, side, 4)
        total: NDArray[np.float32] = covering.sum(axis=(1, 3))
        counts = total[..., 3]
        valid = 2.0 * counts >= side * side
        pixels = np.zeros_like(total)
        pixels[valid, :3] = total[valid, :3] / counts[valid, None]
        pixels[valid, 3] = 1.0
        return pixels
