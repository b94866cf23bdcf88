"""Equirectangular panorama of all directions: columns are longitudes, rows are latitudes.

    longitude = 2π (u + 0.5)/width − π, from +z (the image center) toward +x (right)
    latitude = π/2 − π (v + 0.5)/height, from the horizon upwards (−y)
    (x, y, z) = (cos lat sin lon, −sin lat, cos lat cos lon)

Domain: −0.5 ≤ u ≤ width − 0.5 and −0.5 ≤ v ≤ height − 0.5; all directions.

GLSL twin: `shaders/camera/equirectangular.glsl`. Source: the plate carrée of cartography; equal to
COLMAP's EQUIRECTANGULAR, whose pixel coordinates are larger by 0.5.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from omnisim.cameras.camera import Pixels, Rays, Uniforms, as_directions, as_pixels
from omnisim.cameras.parametric_camera import ParametricCamera


@dataclass(frozen=True)
class EquirectangularCamera(ParametricCamera):
    """Image of all directions, longitude by latitude."""

    model_name = "equirectangular"

    @property
    def principal_point_px(self) -> tuple[float, float]:
        """Center of the image."""
        return 0.5 * (self.width_px - 1), 0.5 * (self.height_px - 1)

    @property
    def radians_per_pixel(self) -> tuple[float, float]:
        """Longitude per column and latitude per row."""
        return 2.0 * math.pi / self.width_px, math.pi / self.height_px

    def ray_from_pixel(self, pixels_px: ArrayLike) -> Rays:
        """Rays of pixels (..., 2); valid inside the image."""
        pixels = as_pixels(pixels_px)
        size = np.array([self.width_px, self.height_px], dtype=np.float64)
        offset = pixels - self.principal_point_px
        valid = np.all(np.abs(offset) <= 0.5 * size, axis=-1)
        angles = offset * self.radians_per_pixel
        # rounding must not move the edge of the last column to that of the first
        limits = (math.pi, 0.5 * math.pi)
        longitude, down = np.moveaxis(np.clip(angles, np.negative(limits), limits), -1, 0)
        level = np.cos(down)
        directions = (level * np.sin(longitude), np.sin(down), level * np.cos(longitude))
        return Rays(np.stack(directions, axis=-1), valid)

    def pixel_from_ray(self, directions: ArrayLike) -> Pixels:
        """Pixels of directions (..., 3) in the optical frame; all are valid."""
        x, y, z = np.moveaxis(as_directions(directions), -1, 0)
        angles = np.stack((np.arctan2(x, z), np.arctan2(y, np.hypot(x, z))), axis=-1)
        positions = angles / self.radians_per_pixel + self.principal_point_px
        return Pixels(positions, np.ones(x.shape, dtype=bool))

    def uniforms(self) -> Uniforms:
        """Values for `shaders/camera/equirectangular.glsl`."""
        return {"u_image_size_px": (float(self.width_px), float(self.height_px))}
