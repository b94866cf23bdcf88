"""Rays of a supersampled image, interpolated between pixels where they vary smoothly."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera, NonCentralCamera, Rays, pixel_grid
from omnisim.rendering.opengl.capture.parallax_rays import MARGIN_PX, ParallaxRays

# Distance within which all pixels must have a ray for a pixel's samples to be interpolated without
# a test: rays bend strongly near a rim. At most the margin.
_SMOOTH_PX = 2
_MISS_PX = 0.02  # maximum error of interpolated rays


def sample_rays(
    camera: CentralCamera, supersampling: int, polygons: int | None = None
) -> ParallaxRays:
    """Rays of the samples of a camera's pixels, in the rig frame.

    Rays of the pixel centers are traced. The rays of all samples are traced near the edges of the
    visible region, and everywhere for a mesh; they are stored where interpolation would fail.

    Args:
        camera: camera with pixels.
        supersampling: samples per pixel side.
        polygons: number of polygons of the mirror mesh; None: exact.
    """
    width, height = camera.width_px, camera.height_px
    trace = _tracer(camera, polygons)
    around = pixel_grid(width + 2 * MARGIN_PX, height + 2 * MARGIN_PX) - MARGIN_PX
    directions, origins_m, valid = trace(around)
    inner = slice(MARGIN_PX, -MARGIN_PX), slice(MARGIN_PX, -MARGIN_PX)
    smooth, near = _all_around(valid, _SMOOTH_PX)[inner], ~_all_around(~valid, 1)[inner]
    beside = _all_around(valid, 1)[inner]  # pixels with all neighbors valid: interpolation possible
    rays = ParallaxRays.interpolated(supersampling, directions, origins_m, smooth)
    rim = np.argwhere(near if polygons is not None else near & ~smooth)
    offsets = (pixel_grid(supersampling, supersampling).reshape(-1, 2) + 0.5) / supersampling - 0.5
    own = trace(rim[:, None, ::-1] + offsets)
    bent = ~beside[tuple(rim.T)] | ~own[2].all(axis=1) | _bent(rays, rim, own[0])
    rays.smooth[tuple(rim.T)] = ~bent
    kept = bent & own[2].any(axis=1)
    rim = rim[kept]
    rays.rim_numbers[tuple(rim.T)] = np.arange(len(rim))
    return replace(
        rays, rim_directions=own[0][kept], rim_origins_m=own[1][kept], rim_valid=own[2][kept]
    )


def _bent(
    rays: ParallaxRays, pixels: NDArray[np.intp], own: NDArray[np.float32]
) -> NDArray[np.bool_]:
    """Mask of pixels (n, 2), row and column, whose sample directions cannot be interpolated.

    The directions (n, samples, 3) differ from those interpolated between neighboring pixels.
    """
    count = rays.supersampling**2
    rows, columns = np.repeat(pixels, count, axis=0).T
    between = rays.of(rows, columns, np.tile(np.arange(count), len(pixels)))
    misses = np.linalg.norm(between.directions.reshape(own.shape) - own, axis=-1).max(axis=1)
    steps = rays.supersampling * np.linalg.norm(between.footprints, axis=-1)
    return np.asarray(misses > _MISS_PX * steps.reshape(len(pixels), 2 * count).min(axis=1))


_Traced = tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_]]


def _tracer(
    camera: CentralCamera, polygons: int | None
) -> Callable[[NDArray[np.float64]], _Traced]:
    """Function from pixels (..., 2) to directions and origins (..., 3), rig frame, and validity.

    Directions are 0 where invalid.
    """
    ray_from_pixel: Callable[[NDArray[np.float64]], Rays] = camera.ray_from_pixel
    if polygons is not None and isinstance(camera, NonCentralCamera):
        from omnisim.cameras.optics.mesh_rays import MeshRays

        ray_from_pixel = MeshRays(camera, polygons).ray_from_pixel

    def trace(pixels: NDArray[np.float64]) -> _Traced:
        rays = ray_from_pixel(pixels)
        assert rays.origins_m is not None
        found = []
        for part in (rays.directions, rays.origins_m):
            values = np.where(rays.valid[..., None], part, 0.0)
            rig = np.einsum("...j,ij->...i", values, camera.rig_from_optical)
            found.append(rig.astype(np.float32))
        return found[0], found[1], rays.valid

    return trace


def _all_around(valid: NDArray[np.bool_], distance_px: int) -> NDArray[np.bool_]:
    """Mask of pixels with only valid ones within a distance; those outside of the image count."""
    for axis in (0, 1):
        padded = np.pad(
            valid,
            [(distance_px,) * 2 if axis == own else (0, 0) for own in (0, 1)],
            constant_values=True,
        )
        size = valid.shape[axis]
        valid = np.logical_and.reduce(
            [padded.take(range(step, step + size), axis) for step in range(2 * distance_px + 1)]
        )
    return valid
