"""What the ideal fisheye lenses have in common: one focal length, one limit, r(θ) in closed form.

The lenses themselves: `equidistant`, `stereographic`, `equisolid`, `orthographic`.
Source: Miyamoto, "Fish eye lens", 1964; Kannala & Brandt 2006, Eq. 1 to 5.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from omnisim.cameras.focal_camera import FocalCamera
from omnisim.cameras.plane_camera import RadialCamera
from omnisim.errors import OpticsError


@dataclass(frozen=True)
class FisheyeCamera(FocalCamera, RadialCamera):
    """A fisheye lens with r/f a function of θ alone, seen up to θ_max.

    Attributes:
        width_px, height_px: size of the picture.
        focal_length_px: focal length f; near the axis as many pixels to a radian.
        principal_point_px: (u, v) of the optical axis in the picture.
        theta_max_rad: angle from the axis where the domain ends.

    Raises:
        OpticsError: a size or focal length that is not positive, a centre that is not finite, or
            θ_max outside the lens's own limits.
    """

    theta_max_rad: float
    largest_theta_rad: ClassVar[float]

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 < self.theta_max_rad <= self.largest_theta_rad:  # false for NaN, too
            raise OpticsError(
                f"camera: theta_max_rad = {self.theta_max_rad:g}, "
                f"{math.degrees(self.theta_max_rad):g}°: want more than 0° and at most "
                f"{math.degrees(self.largest_theta_rad):g}°"
            )

    @property
    def theta_edge_rad(self) -> float:
        """Where the domain ends: θ_max."""
        return self.theta_max_rad

    def uniforms(self) -> dict[str, float | tuple[float, ...]]:
        """Values of the uniforms of `shaders/camera/<model>.glsl`."""
        return {**super().uniforms(), "u_radius_max": self.radius_limits[1]}
