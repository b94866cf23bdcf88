"""Equidistant fisheye, r = f θ: a constant number of pixels per degree along a radius.

Domain: 0 ≤ θ ≤ θ_max ≤ 180°; in the image r ≤ f θ_max.

GLSL twin: `shaders/camera/equidistant.glsl`. Source: Kannala & Brandt 2006, Eq. 3.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras.focal_camera import FisheyeCamera
from omnisim.cameras.parametric_camera import WideTheta


@dataclass(frozen=True)
class EquidistantCamera(FisheyeCamera):
    """Fisheye lens: r = f θ."""

    theta_max_rad: WideTheta = math.pi
    """Angle from the axis where the domain ends."""
    model_name = "equidistant"
    largest_theta_rad = math.pi

    def _radius_from_theta(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        return theta

    def _theta_from_radius(self, radius: NDArray[np.float64]) -> NDArray[np.float64]:
        return radius
