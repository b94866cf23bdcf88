"""Rays of a supersampled picture, interpolated between its pixels where they are smooth."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import scipy  # its submodules load when first used
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera, NonCentralCamera, Rays, pixel_grid

# Pixels around a sample that must have a ray for it to be interpolated: near a rim rays bend fast.
_SMOOTH_PX = 2
_MARGIN_PX = 2  # around the picture


class SampleRays(NamedTuple):
    """Rays of all samples of a picture, optical frame."""

    directions: NDArray[np.float32]  # (height, width, 3), unit
    origins_m: NDArray[np.float32]  # (height, width, 3)
    valid: NDArray[np.bool_]  # (height, width)


def sample_rays(
    camera: CentralCamera, supersampling: int, polygons: int | None = None
) -> SampleRays:
    """Rays of the samples of a camera's pixels; those of the pixels' centres are traced.

    Between them rays are interpolated cubically; near the edges of what is seen they are traced.
    Those of a mesh, which bend at its edges, are all traced.

    Args:
        camera: with pixels.
        supersampling: samples to a side of a pixel.
        polygons: of the mesh of its mirror; None: exact.
    """
    width, height = camera.width_px, camera.height_px
    u, v = ((np.arange(n * supersampling) + 0.5) / supersampling - 0.5 for n in (width, height))
    if polygons is not None and isinstance(camera, NonCentralCamera):
        from omnisim.optics.mesh_rays import MeshRays

        mesh = MeshRays(camera, polygons)
        return _of_mesh(mesh.ray_from_pixel(np.stack(np.meshgrid(u, v), axis=-1)))
    traced = camera.ray_from_pixel(
        pixel_grid(width + 2 * _MARGIN_PX, height + 2 * _MARGIN_PX) - _MARGIN_PX
    )
    origins_m = np.zeros_like(traced.directions) if traced.origins_m is None else traced.origins_m
    values = np.concatenate((traced.directions, origins_m), axis=-1, dtype=np.float32)
    values = _interpolated(_interpolated(values, supersampling, 0), supersampling, 1)
    around = np.ones((2 * _SMOOTH_PX + 1, 2 * _SMOOTH_PX + 1), dtype=np.bool_)
    smooth = scipy.ndimage.binary_erosion(traced.valid, around, border_value=1)
    near = scipy.ndimage.binary_dilation(traced.valid, around)
    rows, columns = (
        np.floor(v + _MARGIN_PX).astype(int)[:, None],
        np.floor(u + _MARGIN_PX).astype(int),
    )
    corners = [(rows + down, columns + right) for down in (0, 1) for right in (0, 1)]
    valid = np.logical_and.reduce([smooth[corner] for corner in corners])
    rest = np.logical_or.reduce([near[corner] for corner in corners]) & ~valid
    at = np.argwhere(rest)
    exact = camera.ray_from_pixel(np.stack((u[at[:, 1]], v[at[:, 0]]), axis=1))
    valid[rest] = exact.valid
    values[rest, :3] = exact.directions
    values[rest, 3:] = 0.0 if exact.origins_m is None else exact.origins_m
    values[~valid] = (0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
    x, y, z = (values[..., axis] for axis in range(3))
    values[..., :3] /= np.sqrt(x * x + y * y + z * z)[..., None]
    return SampleRays(values[..., :3].copy(), values[..., 3:].copy(), valid)


def _of_mesh(rays: Rays) -> SampleRays:
    assert rays.origins_m is not None
    directions, origins_m = rays.directions.astype(np.float32), rays.origins_m.astype(np.float32)
    return SampleRays(directions, origins_m, rays.valid)


def _interpolated(
    values: NDArray[np.float32], supersampling: int, axis: int
) -> NDArray[np.float32]:
    """Values at the samples of pixels (rows, columns, m), without the margin along an axis, by
    cubic convolution.

    Source: Keys 1981.
    """  # fmt: skip
    shape = list(values.shape)
    count = shape[axis] - 2 * _MARGIN_PX
    shape[axis] = count * supersampling
    found = np.empty(shape, dtype=np.float32)
    along = np.moveaxis(values, axis, 0)
    for phase in range(supersampling):
        at = (phase + 0.5) / supersampling - 0.5 + _MARGIN_PX
        first = math.floor(at)
        t = at - first
        weights = (
            ((2.0 - t) * t - 1.0) * t,
            (3.0 * t - 5.0) * t * t + 2.0,
            ((4.0 - 3.0 * t) * t + 1.0) * t,
            (t - 1.0) * t * t,
        )
        taps = [along[first + tap - 1 : first + tap - 1 + count] for tap in range(4)]
        part = np.moveaxis(found, axis, 0)[phase::supersampling]
        np.multiply(taps[0], 0.5 * weights[0], out=part)
        for tap, weight in zip(taps[1:], weights[1:], strict=True):
            part += tap * np.float32(0.5 * weight)
    return found
