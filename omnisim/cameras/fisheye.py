"""Base of the ideal fisheye lenses: one focal length, one limit, r(θ) in closed form.

The lenses themselves: `equidistant`, `stereographic`, `equisolid`, `orthographic`.
Source: Miyamoto, "Fish eye lens", 1964; Kannala & Brandt 2006, Eq. 1 to 5.
"""

from __future__ import annotations

from dataclasses import dataclass

from omnisim.cameras.camera import Uniforms
from omnisim.cameras.focal_camera import FocalCamera
from omnisim.cameras.plane_camera import RadialCamera


@dataclass(frozen=True)
class FisheyeCamera(FocalCamera, RadialCamera):
    """A fisheye lens with r/f a function of θ alone, seen up to θ_max.

    Attributes:
        width_px, height_px: size of the image.
        focal_length_px: focal length f; near the axis as many pixels to a radian.
        principal_point_px: (u, v) of the optical axis in the image.
        theta_max_rad: angle from the axis where the domain ends.

    Raises:
        OpticsError: a size or focal length that is not positive, a center that is not finite, or
            θ_max outside the lens's own limits.
    """

    theta_max_rad: float

    def uniforms(self) -> Uniforms:
        """Values of the uniforms of `shaders/camera/<model>.glsl`."""
        return {**super().uniforms(), "u_radius_max": self.radius_limits[1]}
