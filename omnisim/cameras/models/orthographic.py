"""Orthographic fisheye, r = f sin θ: a sphere seen from far away, compressed at the rim.

Domain: 0 ≤ θ ≤ θ_max ≤ 90°; in the image r ≤ f sin θ_max. Beyond 90° the image would fold over.

GLSL twin: `shaders/camera/orthographic.glsl`. Source: Kannala & Brandt 2006, Eq. 5.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from omnisim.cameras.parametric_camera import FisheyeCamera, ThetaMax
from omnisim.core.arrays import Floats
from omnisim.core.files.parameters import Typical


@dataclass(frozen=True)
class OrthographicCamera(FisheyeCamera):
    """Fisheye lens: r = f sin θ."""

    theta_max_rad: Annotated[ThetaMax, Typical(math.radians(70.0), math.radians(90.0))] = (
        0.5 * math.pi
    )
    """Angle from the axis where the domain ends."""
    model_name = "orthographic"
    largest_theta_rad = 0.5 * math.pi

    def _radius_from_theta(self, theta: Floats) -> Floats:
        return np.sin(theta)

    def _theta_from_radius(self, radius: Floats) -> Floats:
        return np.arcsin(np.minimum(radius, 1.0))
