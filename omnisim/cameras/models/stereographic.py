"""Stereographic fisheye, r = 2 f tan(θ/2): small shapes keep their angles (conformal).

Domain: 0 ≤ θ ≤ θ_max ≤ 179°; in the image r ≤ 2 f tan(θ_max/2). At 180° the image radius is
infinite.

GLSL twin: `shaders/camera/stereographic.glsl`. Source: Kannala & Brandt 2006, Eq. 2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from omnisim.cameras.parametric_camera import FisheyeCamera, ThetaMax
from omnisim.core.arrays import Floats
from omnisim.core.files.parameters import Typical

LIMIT_RAD = math.radians(150.0)


@dataclass(frozen=True)
class StereographicCamera(FisheyeCamera):
    """Fisheye lens: r = 2 f tan(θ/2)."""

    theta_max_rad: Annotated[ThetaMax, Typical(math.radians(90.0), math.radians(120.0))] = LIMIT_RAD
    """Angle from the axis where the domain ends."""
    model_name = "stereographic"
    largest_theta_rad = math.radians(179.0)

    def _radius_from_theta(self, theta: Floats) -> Floats:
        return 2.0 * np.tan(0.5 * theta)

    def _theta_from_radius(self, radius: Floats) -> Floats:
        return 2.0 * np.arctan(0.5 * radius)
