"""Markers on the rays of a non-central optical system."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras.optics import OpticalSystem, ray_jacobians
from omnisim.scene import Scene
from omnisim.scene.model import Mesh
from omnisim.validation.markers import WINDOW_PX
from omnisim.validation.plain_scenes import WHITE, plain_scene

RADIUS_PX = 6.0  # longer half axis of a marker in the image
STRETCH = 3.0  # maximum ratio of a marker's axes in the image
_MIN_M, _MAX_M = 0.4, 8.0
_CORNERS = 96


def marker_pixels(system: OpticalSystem, spacing_px: int) -> NDArray[np.float64]:
    """Evenly spaced pixels (n, 2), amid valid rays, at which a marker's stretch is small enough."""
    half = 0.5 * spacing_px
    u, v = (np.arange(half, size, spacing_px) for size in (system.width_px, system.height_px))
    pixels = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    angles = 2.0 * np.pi * np.arange(16) / 16
    reach_px = WINDOW_PX + 3.0
    around = pixels[:, None] + reach_px * np.stack((np.cos(angles), np.sin(angles)), axis=1)
    inside = (around >= 0.0) & (around <= (system.width_px - 1, system.height_px - 1))
    valid = system.rays(around).valid & inside.all(axis=2)
    kept = pixels[valid.all(axis=1) & system.rays(pixels).valid]
    sizes = _sizes(system, kept, np.ones(len(kept)))
    return kept[sizes[:, 0] < STRETCH * sizes[:, 1]]


def markers_on_rays(
    system: OpticalSystem, pixels_px: NDArray[np.float64], world_from_optical: NDArray[np.float64]
) -> Scene:
    """Scene of white discs on black, perpendicular to the rays of pixels (n, 2), at 0.4 to 8 m."""
    rays = system.rays(pixels_px)
    generator = np.random.default_rng(7)
    share = generator.random(len(pixels_px))
    ranges_m = _MIN_M * (_MAX_M / _MIN_M) ** share
    radii_m = RADIUS_PX * _sizes(system, pixels_px, ranges_m)[:, 1]
    middles_m = rays.origins_m + ranges_m[:, None] * rays.directions
    frames = _frames(rays.directions)
    angles = 2.0 * np.pi * np.arange(_CORNERS) / _CORNERS
    circle = np.stack((np.cos(angles), np.sin(angles)), axis=1)
    rims_m = middles_m[:, None] + radii_m[:, None, None] * np.einsum("kc,nic->nki", circle, frames)
    places_m = np.concatenate((middles_m, rims_m.reshape(-1, 3)))
    places_m = places_m @ world_from_optical[:3, :3].T + world_from_optical[:3, 3]
    count = len(pixels_px)
    corner = np.arange(_CORNERS)
    first = count + _CORNERS * np.arange(count)[:, None]
    disc = np.broadcast_to(np.arange(count)[:, None], (count, _CORNERS))
    triangles = np.stack((disc, first + corner, first + (corner + 1) % _CORNERS), axis=-1)
    mesh = Mesh("markers", places_m.astype("f4"), triangles.reshape(-1, 3).astype("u4"), 0)
    return plain_scene("markers", (mesh, WHITE))


def _sizes(
    system: OpticalSystem, pixels_px: NDArray[np.float64], ranges_m: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Maximum and minimum meters per pixel (n, 2), perpendicular to the rays at ranges (n,)."""
    by_pixel = ray_jacobians(system, pixels_px)
    moved = by_pixel.origins_m + ranges_m[:, None, None] * by_pixel.directions
    frames = _frames(system.rays(pixels_px).directions)
    return np.linalg.svd(np.einsum("nic,nij->ncj", frames, moved), compute_uv=False)


def _frames(directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Orthonormal bases (n, 3, 2) of the planes perpendicular to directions (n, 3)."""
    smallest = np.eye(3)[np.abs(directions).argmin(axis=1)]
    first = np.cross(directions, smallest)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack((first, np.cross(directions, first)), axis=2)
