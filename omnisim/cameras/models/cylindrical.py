"""Cylindrical panorama: vertical lines stay straight, and turning the camera shifts the image.

    (u, v) = (f atan2(x, z) + u0, f y/√(x² + z²) + v0)

Domain: azimuths from −180° to 180°; all directions except ±y, the cylinder's axis.

GLSL twin: `shaders/camera/cylindrical.glsl`. Source: Szeliski, "Computer vision", section 8.2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from omnisim.cameras.camera import CentralCamera, Pixels, Rays, as_directions, as_pixels
from omnisim.cameras.models.equirectangular import EquirectangularCamera
from omnisim.cameras.parametric_camera import FocalCamera


@dataclass(frozen=True)
class CylindricalCamera(FocalCamera):
    """An image on a cylinder around the y axis of the optical frame.

    A column is an azimuth from the z axis toward x, (u − u0)/f in radians. A row is the tangent of
    an elevation, (v − v0)/f downwards. Azimuths run from −180° to 180°.
    """

    model_name = "cylindrical"

    def ray_from_pixel(self, pixels_px: ArrayLike) -> Rays:
        """Rays of pixels (..., 2); valid where the azimuth is within ±180°."""
        pixels = as_pixels(pixels_px)
        scaled = (pixels - self.principal_point_px) / self.focal_length_px
        azimuth, tangent = scaled[..., 0], scaled[..., 1]
        directions = np.stack((np.sin(azimuth), tangent, np.cos(azimuth)), axis=-1)
        directions /= np.sqrt(1.0 + tangent * tangent)[..., None]
        return Rays(directions, np.abs(azimuth) <= math.pi)

    def pixel_from_ray(self, directions: ArrayLike) -> Pixels:
        """Pixels of directions (..., 3) in the optical frame; valid off the cylinder's axis."""
        rays = as_directions(directions)
        across = np.hypot(rays[..., 0], rays[..., 2])
        valid = across > 1e-12 * np.abs(rays[..., 1])
        tangent = rays[..., 1] / np.where(valid, across, 1.0)
        azimuth = np.arctan2(rays[..., 0], rays[..., 2])
        scaled = np.stack((azimuth, tangent), axis=-1)
        return Pixels(self.focal_length_px * scaled + self.principal_point_px, valid)


def period_px(camera: CentralCamera) -> float | None:
    """Period of a 360° panorama in pixels; None if the image does not wrap around."""
    if isinstance(camera, EquirectangularCamera):
        return float(camera.width_px)
    if isinstance(camera, CylindricalCamera):
        turn_px = 2.0 * math.pi * camera.focal_length_px
        return turn_px if camera.width_px >= turn_px - 1.0 else None
    return None
