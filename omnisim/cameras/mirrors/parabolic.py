"""Parabolic mirror with an orthographic camera below it: the paper's Eq. 2, exactly.

    r = h tan(θ/2) = h sin θ/(1 + cos θ)

θ is measured at the mirror's focus from its axis: 0 looks down at the camera, and 90° is the
horizon, with the radius h in the image. A mirror z = (h_m² − r²)/(2 h_m) and a camera with p pixels
per meter give h = p h_m; nothing else about them affects the image. The ray of a pixel is
(sin θ cos φ, sin θ sin φ, −cos θ), as for the hyperbolic mirror, which approaches this mirror as
ξ → 1.

Domain: 0 ≤ θ ≤ θ_max < 180°; in the image r ≤ h tan(θ_max/2).

| parameter | unit | typical |
| --- | --- | --- |
| horizon_radius_px | px | 100 to 500 |
| principal_point_px | px | image center |
| theta_max_deg | degrees | 90 to 110 |

GLSL twin: `shaders/camera/parabolic.glsl`. Source: Baker & Nayar 1999, section 2.2 (the
paraboloid); Schmits & Visser 2008, Eq. 2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras.camera import Rays, Uniforms
from omnisim.cameras.model_parameters import check_limits
from omnisim.cameras.plane_camera import PlanePoints, RadialCamera
from omnisim.core.coordinate_frames import FLIP_Z, RIG_FROM_OPTICAL_LOOKING_UP


@dataclass(frozen=True)
class ParabolicCamera(RadialCamera):
    """Camera that looks at a parabolic mirror.

    Attributes:
        width_px, height_px: image size.
        horizon_radius_px: h, radius of the 90° circle.
        principal_point_px: (u, v) of the mirror's axis in the image.
        theta_max_rad: angle of incidence of the rim.

    Raises:
        OpticsError: a size or radius is not positive, the center is not finite, or the rim is not
            between 0 and 179°.
    """

    horizon_radius_px: float
    principal_point_px: tuple[float, float]
    theta_max_rad: float = math.radians(105.0)
    model_name = "parabolic"
    _rig_from_optical: ClassVar[NDArray[np.float64]] = RIG_FROM_OPTICAL_LOOKING_UP
    largest_theta_rad = math.radians(179.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        check_limits(self, "horizon_radius_px", 1e-6, math.inf, "more than 0")

    @property
    def pixels_per_plane(self) -> float:
        """Pixels per unit of the normalized plane, h."""
        return self.horizon_radius_px

    def _radius_from_theta(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.tan(0.5 * theta)

    def _theta_from_radius(self, radius: NDArray[np.float64]) -> NDArray[np.float64]:
        return 2.0 * np.arctan(radius)

    def _rays_from_plane(self, plane: NDArray[np.float64]) -> Rays:
        rays = super()._rays_from_plane(plane)
        return Rays(rays.directions * FLIP_Z, rays.valid)

    def _plane_from_rays(self, directions: NDArray[np.float64]) -> PlanePoints:
        return super()._plane_from_rays(directions * FLIP_Z)

    def uniforms(self) -> Uniforms:
        """Values for `shaders/camera/parabolic.glsl`."""
        return {
            "u_horizon_radius_px": self.horizon_radius_px,
            "u_principal_point_px": self.principal_point_px,
            "u_rim_half_tangent": self.radius_limits[1],
        }
