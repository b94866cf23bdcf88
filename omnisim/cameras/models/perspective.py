"""Pinhole camera: straight lines stay straight.

    (u, v) = f (x, y)/z + (u0, v0)

Domain: z > 0, all pixels.

GLSL twin: `shaders/camera/perspective.glsl`. Source: Hartley & Zisserman, "Multiple view geometry
in computer vision", section 6.1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from omnisim.cameras.camera import Pixels, Rays, as_directions, as_pixels
from omnisim.cameras.parametric_camera import FocalCamera
from omnisim.core.errors import OpticsError


@dataclass(frozen=True)
class PerspectiveCamera(FocalCamera):
    """Camera without a mirror or distortion: (u, v) = f (x, y)/z + center, for z > 0."""

    model_name = "perspective"

    @classmethod
    def with_field_of_view(
        cls, width_px: int, height_px: int, field_of_view_rad: float
    ) -> PerspectiveCamera:
        """Camera with a horizontal field of view of `field_of_view_rad`, centered on its axis.

        Raises:
            OpticsError: the field of view is not between 0 and 180°, or a size is below 1.
        """
        if not 0.0 < field_of_view_rad < math.pi:
            raise OpticsError(
                "camera: field of view: expected more than 0° and less than 180°, "
                f"got {math.degrees(field_of_view_rad):g}°"
            )
        focal_length_px = 0.5 * width_px / math.tan(0.5 * field_of_view_rad)
        middle = (0.5 * (width_px - 1), 0.5 * (height_px - 1))
        return cls(width_px, height_px, focal_length_px, middle)

    def ray_from_pixel(self, pixels_px: ArrayLike) -> Rays:
        """Rays of pixels (..., 2); all are valid."""
        pixels = as_pixels(pixels_px)
        tangents = (pixels - self.principal_point_px) / self.focal_length_px
        directions = np.concatenate((tangents, np.ones_like(tangents[..., :1])), axis=-1)
        directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
        return Rays(directions, np.ones(pixels.shape[:-1], dtype=bool))

    def pixel_from_ray(self, directions: ArrayLike) -> Pixels:
        """Pixels of directions (..., 3) in the optical frame; valid in front of the camera."""
        rays = as_directions(directions)
        # at 90° from the axis the image is infinitely far away
        valid = rays[..., 2] > 1e-12 * np.hypot(rays[..., 0], rays[..., 1])
        depth = np.where(valid, rays[..., 2], 1.0)[..., None]
        return Pixels(self.focal_length_px * rays[..., :2] / depth + self.principal_point_px, valid)
