"""Bases of models that project rays onto a normalized plane, scaled and shifted to the image.

`PlaneCamera` maps between image and plane; a subclass maps between plane and rays. `RadialCamera`
is the subclass for radially symmetric lenses, for which a model provides only r(θ) and θ(r).
"""

from __future__ import annotations

import math
from abc import abstractmethod
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from omnisim.cameras.camera import Pixels, Rays, as_directions, as_pixels
from omnisim.cameras.parametric_camera import ParametricCamera
from omnisim.core.arrays import Bools, Floats

# The ray of a pixel on the edge of the domain is rounded; its projection must still be valid.
EDGE_RAD = 1e-12


class PlanePoints(NamedTuple):
    """Points of the normalized plane."""

    positions: Floats  # (..., 2): x right, y down, in focal lengths
    valid: Bools  # (...,)


class PlaneCamera(ParametricCamera):
    """Mixin that maps pixels to rays and back through the normalized plane."""

    @property
    @abstractmethod
    def pixels_per_plane(self) -> float | tuple[float, float]:
        """Pixels per unit of the normalized plane."""

    @abstractmethod
    def _rays_from_plane(self, plane: Floats) -> Rays:
        """Rays of points (..., 2) in the plane; outside the domain, those of its nearest edge."""

    @abstractmethod
    def _plane_from_rays(self, directions: Floats) -> PlanePoints:
        """Points (..., 2) of the plane for directions (..., 3) of any length."""

    def ray_from_pixel(self, pixels_px: ArrayLike) -> Rays:
        """Rays of pixels (..., 2): unit directions in the optical frame; valid in the domain."""
        return self._rays_from_plane(self._plane_from_pixels(as_pixels(pixels_px)))

    def pixel_from_ray(self, directions: ArrayLike) -> Pixels:
        """Pixels of directions (..., 3) in the optical frame; valid in the domain."""
        points = self._plane_from_rays(as_directions(directions))
        return Pixels(self._pixels_from_plane(points.positions), points.valid)

    def _plane_from_pixels(self, pixels: Floats) -> Floats:
        return (pixels - self.principal_point_px) / self.pixels_per_plane

    def _pixels_from_plane(self, plane: Floats) -> Floats:
        return plane * self.pixels_per_plane + self.principal_point_px


class RadialCamera(PlaneCamera):
    """Radially symmetric lens with radius r on the plane and angle θ from +z.

    Domain: θ_min ≤ θ ≤ θ_edge, where r(θ) increases; on the plane r(θ_min) ≤ r ≤ r(θ_edge).
    """

    @property
    def theta_min_rad(self) -> float:
        """Angle from +z where the domain begins."""
        return 0.0

    @property
    def theta_edge_rad(self) -> float:
        """Angle from +z where the domain ends: θ_max."""
        limit = self.domain_limit_rad
        return math.pi if limit is None else limit

    @abstractmethod
    def _radius_from_theta(self, theta: Floats) -> Floats:
        """Radius r (...,) on the plane at θ (...,), in the domain."""

    @abstractmethod
    def _theta_from_radius(self, radius: Floats) -> Floats:
        """θ (...,) at radius r (...,) on the plane, in the domain."""

    @cached_property
    def radius_limits(self) -> tuple[float, float]:
        """Smallest and largest radius on the plane."""
        ends = np.array([self.theta_min_rad, self.theta_edge_rad])
        first, last = self._radius_from_theta(ends).tolist()
        return first, last

    def _rays_from_plane(self, plane: Floats) -> Rays:
        radius = np.hypot(plane[..., 0], plane[..., 1])
        first, last = self.radius_limits
        theta = self._theta_from_radius(np.clip(radius, first, last))
        across = unit_vectors(plane, radius) * np.sin(theta)[..., None]
        directions = np.concatenate((across, np.cos(theta)[..., None]), axis=-1)
        return Rays(directions, (radius >= first) & (radius <= last))

    def _plane_from_rays(self, directions: Floats) -> PlanePoints:
        across = np.hypot(directions[..., 0], directions[..., 1])
        theta = np.arctan2(across, directions[..., 2])
        first, last = self.theta_min_rad, self.theta_edge_rad
        radius = self._radius_from_theta(np.clip(theta, first, last))
        positions = unit_vectors(directions[..., :2], across) * radius[..., None]
        return PlanePoints(positions, (theta >= first - EDGE_RAD) & (theta <= last + EDGE_RAD))


def unit_vectors(vectors: Floats, lengths: Floats) -> Floats:
    """Normalize vectors (..., 2) by their lengths (...,); (1, 0) for zero vectors."""
    start = np.zeros_like(vectors)
    start[..., 0] = 1.0
    lengths = np.broadcast_to(lengths[..., None], vectors.shape)
    return np.divide(vectors, lengths, out=start, where=lengths > 0.0)
