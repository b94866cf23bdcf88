"""Derivatives of a system's rays by pixel, and its caustic, where neighboring rays meet.

Source: Swaminathan, Grossberg & Nayar, Caustics of catadioptric cameras (ICCV 2001): the points
o + t d at which the Jacobian by pixel and t is singular; this is a quadratic equation in t.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from omnisim.cameras.camera import as_directions, as_pixels
from omnisim.cameras.optics.shapes.shape import Floats
from omnisim.cameras.optics.tracing import TracedRays

_STEP_PX = 1e-3


class Tracer(Protocol):
    """Interface of a system that traces rays."""

    def rays(self, pixels_px: ArrayLike) -> TracedRays:
        """Rays of pixels (..., 2)."""
        ...


class RayJacobians(NamedTuple):
    """Derivatives of rays by pixel; NaN next to pixels that see nothing."""

    origins_m: Floats  # (..., 3, 2) by (u, v), along the last surface
    directions: Floats  # (..., 3, 2)


def ray_jacobians(system: Tracer, pixels_px: ArrayLike) -> RayJacobians:
    """Derivatives of the rays of pixels (..., 2), by fourth-order central differences."""
    pixels = as_pixels(pixels_px)
    origins = np.zeros((*pixels.shape[:-1], 3, 2))
    directions = np.zeros_like(origins)
    for axis in range(2):
        step = np.eye(2)[axis] * _STEP_PX
        for factor, weight in ((1.0, 8.0), (-1.0, -8.0), (2.0, -1.0), (-2.0, 1.0)):
            rays = system.rays(pixels + factor * step)
            share = np.where(rays.valid, weight / (12.0 * _STEP_PX), np.nan)[..., None]
            origins[..., axis] += share * rays.origins_m
            directions[..., axis] += share * rays.directions
    return RayJacobians(origins, directions)


def pixel_jacobians(system: Tracer, pixels_px: ArrayLike, points_m: ArrayLike) -> Floats:
    """Derivatives (..., 2, 3) of the pixels of points (..., 3) with respect to the points.

    Args:
        system: optical system.
        pixels_px: (..., 2) pixels of the points, from `pixel_from_point`.
        points_m: points in the sensor's optical frame.
    """
    rays, by_pixel = system.rays(pixels_px), ray_jacobians(system, pixels_px)
    away = as_directions(points_m) - rays.origins_m
    lengths_m = np.einsum("...j,...j->...", away, rays.directions)[..., None, None]
    across = _across(rays.directions)
    moved = np.einsum("...ji,...jk->...ik", across, by_pixel.origins_m)
    moved += lengths_m * np.einsum("...ji,...jk->...ik", across, by_pixel.directions)
    # perpendicular to the ray, the point moves with the pixel: a 2 × 2 system, by Cramer's rule
    swapped = np.stack(
        (
            np.stack((moved[..., 1, 1], -moved[..., 0, 1]), axis=-1),
            np.stack((-moved[..., 1, 0], moved[..., 0, 0]), axis=-1),
        ),
        axis=-2,
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = swapped / _determinants(moved)[..., None, None]
    jacobians: Floats = np.einsum("...ij,...kj->...ik", inverse, across)
    return jacobians


def caustic_points(system: Tracer, pixels_px: ArrayLike) -> Floats:
    """Points (..., 2, 3) where each pixel's ray touches the two sheets of the caustic.

    NaN where it touches no sheet, or only at infinity.
    """
    rays = system.rays(pixels_px)
    by_pixel = ray_jacobians(system, pixels_px)
    frame = _across(rays.directions)
    o, d = (np.einsum("...ji,...jk->...ik", frame, part) for part in by_pixel)
    square, constant = _determinants(d), _determinants(o)
    linear = (
        o[..., 0, 0] * d[..., 1, 1]
        + d[..., 0, 0] * o[..., 1, 1]
        - o[..., 0, 1] * d[..., 1, 0]
        - d[..., 0, 1] * o[..., 1, 0]
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        # rounding may leave a double root with none
        root = np.sqrt(np.maximum(linear**2 - 4.0 * square * constant, 0.0))
        lengths = np.stack(((-linear - root) / (2.0 * square), (-linear + root) / (2.0 * square)))
    lengths = np.moveaxis(np.where(np.isfinite(lengths), lengths, np.nan), 0, -1)
    origins_m = np.where(rays.valid[..., None], rays.origins_m, np.nan)
    points_m: Floats = origins_m[..., None, :] + lengths[..., None] * rays.directions[..., None, :]
    return points_m


def _determinants(matrices: Floats) -> Floats:
    """Determinants (...,) of matrices (..., 2, 2)."""
    determinants: Floats = (
        matrices[..., 0, 0] * matrices[..., 1, 1] - matrices[..., 0, 1] * matrices[..., 1, 0]
    )
    return determinants


def _across(directions: Floats) -> Floats:
    """Orthonormal bases (..., 3, 2) of the planes perpendicular to directions (..., 3)."""
    smallest = np.eye(3)[np.abs(directions).argmin(axis=-1)]
    first = np.cross(directions, smallest)
    first /= np.linalg.norm(first, axis=-1, keepdims=True)
    return np.stack((first, np.cross(directions, first)), axis=-1)
