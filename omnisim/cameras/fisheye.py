"""Base of the ideal fisheye lenses: one focal length, one limit, r(θ) in closed form.

The subclasses are `equidistant`, `stereographic`, `equisolid` and `orthographic`.
Source: Miyamoto, "Fish eye lens", 1964; Kannala & Brandt 2006, Eq. 1 to 5.
"""

from __future__ import annotations

from dataclasses import dataclass

from omnisim.cameras.camera import Uniforms
from omnisim.cameras.focal_camera import FocalCamera
from omnisim.cameras.parametric_camera import ThetaMax
from omnisim.cameras.plane_camera import RadialCamera


@dataclass(frozen=True)
class FisheyeCamera(FocalCamera, RadialCamera):
    """Fisheye lens whose r/f is a function of θ alone, up to θ_max."""

    theta_max_rad: ThetaMax
    """Angle from the axis where the domain ends."""

    def uniforms(self) -> Uniforms:
        """Uniforms for `shaders/camera/<model>.glsl`."""
        return {**super().uniforms(), "u_radius_max": self.radius_limits[1]}
