"""Equisolid fisheye, r = 2 f sin(θ/2): equal solid angles have equal areas.

Domain: 0 ≤ θ ≤ θ_max ≤ 180°; in the image r ≤ 2 f sin(θ_max/2).

GLSL twin: `shaders/camera/equisolid.glsl`. Source: Kannala & Brandt 2006, Eq. 4.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from omnisim.cameras.parametric_camera import FisheyeCamera, WideTheta
from omnisim.core.arrays import Floats


@dataclass(frozen=True)
class EquisolidCamera(FisheyeCamera):
    """Fisheye lens: r = 2 f sin(θ/2)."""

    theta_max_rad: WideTheta = math.pi
    """Angle from the axis where the domain ends."""
    model_name = "equisolid"
    largest_theta_rad = math.pi

    def _radius_from_theta(self, theta: Floats) -> Floats:
        return 2.0 * np.sin(0.5 * theta)

    def _theta_from_radius(self, radius: Floats) -> Floats:
        return 2.0 * np.arcsin(np.minimum(0.5 * radius, 1.0))
