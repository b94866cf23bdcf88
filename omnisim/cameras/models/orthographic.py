"""Orthographic fisheye, r = f sin θ: a sphere seen from far away, compressed at the rim.

Domain: 0 ≤ θ ≤ θ_max ≤ 90°; in the image r ≤ f sin θ_max. Beyond 90° the image would fold over.

| parameter | unit | typical |
| --- | --- | --- |
| focal_length_px | px | 100 to 1000 |
| principal_point_px | px | image center |
| theta_max_deg | degrees | 70 to 90 |

GLSL twin: `shaders/camera/orthographic.glsl`. Source: Kannala & Brandt 2006, Eq. 5.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras.fisheye import FisheyeCamera


@dataclass(frozen=True)
class OrthographicCamera(FisheyeCamera):
    """Fisheye with r = f sin θ; see `FisheyeCamera` for its attributes."""

    theta_max_rad: float = 0.5 * math.pi
    model_name = "orthographic"
    largest_theta_rad = 0.5 * math.pi

    def _radius_from_theta(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.sin(theta)

    def _theta_from_radius(self, radius: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.arcsin(np.minimum(radius, 1.0))
