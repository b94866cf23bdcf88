"""Elliptic mirror: the pinhole is at one focus, and the effective viewpoint at the other.

A ray from the scene passes through the effective viewpoint, reflects off the concave inner side of
the ellipsoid behind it, and continues to the pinhole. Rays physically cross at the viewpoint, so
the image is upside down as in a telescope: a mirror point at azimuth φ shows the scene at φ + 180°.
With the ellipsoid's eccentricity e and the angle β at the pinhole:

    tan(θ/2) = K tan(β/2),  K = (1 + e)/(1 − e),  r = f tan β

θ is measured at the viewpoint from the direction of the pinhole: 0 looks back at the camera, 90° is
the horizon. The law is that of the hyperbolic mirror with eccentricity 1/e, and that of the unified
model with ξ = 2e/(1 + e²). The ray of a pixel is (−sin θ cos φ, −sin θ sin φ, −cos θ). In Baker and
Nayar's terms, e = c/√(2k + c²); k and c have no other effect on the image.

Domain: 0 ≤ θ ≤ θ_max ≤ 90°: a mirror that reached further would block its own light. The outside of
the ellipsoid is not used, because the pinhole is inside. With e = 0 the mirror is a sphere and
would see itself; e = 1 is the parabolic mirror.

GLSL twin: `shaders/camera/elliptic.glsl`. Source: Baker & Nayar 1999, section 2.2 (the ellipsoid).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from omnisim.cameras.camera import Rays, Uniforms
from omnisim.cameras.parametric_camera import FocalCamera, PlanePoints, RadialCamera, ThetaMax
from omnisim.core.arrays import Floats
from omnisim.core.coordinate_frames import RIG_FROM_OPTICAL_LOOKING_UP
from omnisim.core.files.parameters import Number, Typical

ECCENTRICITIES = (0.01, 0.9999)
HALF_TURN = np.diag([-1.0, -1.0, 1.0])  # puts the rig's front at the top of the image


@dataclass(frozen=True)
class EllipticCamera(FocalCamera, RadialCamera):
    """Camera that looks at the inside of an elliptic mirror."""

    eccentricity: Annotated[
        Number, Field(ge=ECCENTRICITIES[0], le=ECCENTRICITIES[1]), Typical(0.5, 0.9)
    ]
    """e of the ellipsoid."""
    theta_max_rad: ThetaMax = 0.5 * math.pi
    """Angle of the rim at the viewpoint."""
    model_name = "elliptic"
    _rig_from_optical: ClassVar[Floats] = RIG_FROM_OPTICAL_LOOKING_UP @ HALF_TURN
    largest_theta_rad = 0.5 * math.pi

    @property
    def half_angle_ratio(self) -> float:
        """K in tan(θ/2) = K tan(β/2)."""
        return (1.0 + self.eccentricity) / (1.0 - self.eccentricity)

    def _radius_from_theta(self, theta: Floats) -> Floats:
        half = np.tan(0.5 * theta) / self.half_angle_ratio
        return 2.0 * half / (1.0 - half * half)

    def _theta_from_radius(self, radius: Floats) -> Floats:
        half = radius / (1.0 + np.sqrt(1.0 + radius * radius))
        return 2.0 * np.arctan(self.half_angle_ratio * half)

    def _rays_from_plane(self, plane: Floats) -> Rays:
        to_mirror = super()._rays_from_plane(plane)
        return Rays(-to_mirror.directions, to_mirror.valid)

    def _plane_from_rays(self, directions: Floats) -> PlanePoints:
        return super()._plane_from_rays(-directions)

    def uniforms(self) -> Uniforms:
        """Values for `shaders/camera/elliptic.glsl`."""
        return {
            **super().uniforms(),
            "u_half_angle_ratio": self.half_angle_ratio,
            "u_rim_half_tangent": math.tan(0.5 * self.theta_max_rad),
        }
