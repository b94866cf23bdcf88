"""Plane mirror with a pinhole camera below it: perspective, with z reflected.

    (u, v) = f (x, y)/(−z) + (u0, v0)

The effective viewpoint is the mirror image of the pinhole. The model is the limit k = 2 of the
hyperbolic mirror, without a rim.

Domain: z < 0, all pixels.

GLSL twin: `shaders/camera/planar.glsl`. Source: Baker & Nayar 1999, section 2.2 (the plane).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from numpy.typing import ArrayLike

from omnisim.cameras.camera import Pixels, Rays, as_directions
from omnisim.cameras.models.perspective import PerspectiveCamera
from omnisim.core.arrays import Floats
from omnisim.core.coordinate_frames import FLIP_Z, RIG_FROM_OPTICAL_LOOKING_UP


@dataclass(frozen=True)
class PlanarCamera(PerspectiveCamera):
    """Camera that looks at a plane mirror."""

    model_name = "planar"
    _rig_from_optical: ClassVar[Floats] = RIG_FROM_OPTICAL_LOOKING_UP

    def ray_from_pixel(self, pixels_px: ArrayLike) -> Rays:
        """Rays of pixels (..., 2); all are valid."""
        rays = super().ray_from_pixel(pixels_px)
        return Rays(rays.directions * FLIP_Z, rays.valid)

    def pixel_from_ray(self, directions: ArrayLike) -> Pixels:
        """Pixels of directions (..., 3) in the optical frame; valid in front of the mirror."""
        return super().pixel_from_ray(as_directions(directions) * FLIP_Z)
