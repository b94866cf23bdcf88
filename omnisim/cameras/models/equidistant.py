"""Equidistant fisheye, r = f θ: a constant number of pixels per degree along a radius.

Domain: 0 ≤ θ ≤ θ_max ≤ 180°; in the image r ≤ f θ_max.

GLSL twin: `shaders/camera/equidistant.glsl`. Source: Kannala & Brandt 2006, Eq. 3.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from omnisim.cameras.parametric_camera import FisheyeCamera, WideTheta
from omnisim.core.arrays import Floats


@dataclass(frozen=True)
class EquidistantCamera(FisheyeCamera):
    """Fisheye lens: r = f θ."""

    theta_max_rad: WideTheta = math.pi
    """Angle from the axis where the domain ends."""
    model_name = "equidistant"
    largest_theta_rad = math.pi

    def _radius_from_theta(self, theta: Floats) -> Floats:
        return theta

    def _theta_from_radius(self, radius: Floats) -> Floats:
        return radius
