"""Parabolic mirror with an orthographic camera below it: the paper's Eq. 2, exactly.

    r = h tan(θ/2) = h sin θ/(1 + cos θ)

θ is measured at the mirror's focus from its axis: 0 looks down at the camera, and 90° is the
horizon, with the radius h in the image. A mirror z = (h_m² − r²)/(2 h_m) and a camera with p pixels
per meter give h = p h_m; nothing else about them affects the image. The ray of a pixel is
(sin θ cos φ, sin θ sin φ, −cos θ), as for the hyperbolic mirror, which approaches this mirror as
ξ → 1.

Domain: 0 ≤ θ ≤ θ_max < 180°; in the image r ≤ h tan(θ_max/2).

GLSL twin: `shaders/camera/parabolic.glsl`. Source: Baker & Nayar 1999, section 2.2 (the
paraboloid); Schmits & Visser 2008, Eq. 2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from omnisim.cameras.camera import Rays, Uniforms
from omnisim.cameras.parametric_camera import PlanePoints, PrincipalPoint, RadialCamera, WideTheta
from omnisim.core.arrays import Floats
from omnisim.core.coordinate_frames import FLIP_Z, RIG_FROM_OPTICAL_LOOKING_UP
from omnisim.core.files.parameters import Number, Typical

DEFAULT_RIM_RAD = math.radians(105.0)


@dataclass(frozen=True)
class ParabolicCamera(RadialCamera):
    """Camera that looks at a parabolic mirror."""

    horizon_radius_px: Annotated[Number, Field(ge=1e-6), Typical(100.0, 500.0)]
    """Radius h of the 90° circle."""
    principal_point_px: PrincipalPoint
    """(u, v) of the mirror's axis in the image; typically its center."""
    theta_max_rad: WideTheta = DEFAULT_RIM_RAD
    """Angle of incidence of the rim."""
    model_name = "parabolic"
    _rig_from_optical: ClassVar[Floats] = RIG_FROM_OPTICAL_LOOKING_UP
    largest_theta_rad = math.radians(179.0)

    @property
    def pixels_per_plane(self) -> float:
        """Pixels per unit of the normalized plane, h."""
        return self.horizon_radius_px

    def _radius_from_theta(self, theta: Floats) -> Floats:
        return np.tan(0.5 * theta)

    def _theta_from_radius(self, radius: Floats) -> Floats:
        return 2.0 * np.arctan(radius)

    def _rays_from_plane(self, plane: Floats) -> Rays:
        rays = super()._rays_from_plane(plane)
        return Rays(rays.directions * FLIP_Z, rays.valid)

    def _plane_from_rays(self, directions: Floats) -> PlanePoints:
        return super()._plane_from_rays(directions * FLIP_Z)

    def uniforms(self) -> Uniforms:
        """Values for `shaders/camera/parabolic.glsl`."""
        return {
            "u_horizon_radius_px": self.horizon_radius_px,
            "u_principal_point_px": self.principal_point_px,
            "u_rim_half_tangent": self.radius_limits[1],
        }
