"""Division model of a wide lens: the ray of a point is (x, y, 1 + k r²).

    x = (u − cx)/fx, y = (v − cy)/fy, r² = x² + y²
    ray ~ (x, y, 1 + k r²)
    r = 2 sin θ / (cos θ + √(cos² θ − 4 k sin² θ))

Domain: 0 ≤ θ ≤ θ_max and r ≤ 50. With k > 0 the image folds at r = 1/√k; the domain ends where
1 − k r², the slope of θ(r) but for a factor, has fallen to a thousandth. With k < 0 there is no
fold, and where 1 + k r² < 0 it sees beyond 90°.

GLSL twin: `shaders/camera/division.glsl`. Source: Fitzgibbon, "Simultaneous linear estimation of
multiple view geometry and lens distortion", 2001; COLMAP's DIVISION and SIMPLE_DIVISION.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import numpy as np

from omnisim.cameras.camera import Uniforms
from omnisim.cameras.parametric_camera import (
    Coefficient,
    RadialCamera,
    TwoFocalCamera,
    WideTheta,
)
from omnisim.core.arrays import Floats
from omnisim.core.files.parameters import Typical

MAX_RADIUS = 50.0
MIN_SLOPE = 1e-3  # share of the slope at the axis


@dataclass(frozen=True)
class DivisionCamera(TwoFocalCamera, RadialCamera):
    """Lens whose undistorted radius is r/(1 + k r²)."""

    k: Annotated[Coefficient, Typical(-0.5, 0.0)]
    """Distortion; negative: barrel, as of wide lenses."""
    theta_max_rad: WideTheta = math.pi
    """Angle from the axis where the domain ends, unless the fold comes first."""
    model_name = "division"

    @cached_property
    def theta_edge_rad(self) -> float:
        """Angle from the axis where the domain ends: θ_max, or the fold before it."""
        fold = math.sqrt((1.0 - MIN_SLOPE) / self.k) if self.k > 0.0 else MAX_RADIUS
        radius = min(MAX_RADIUS, fold)
        return min(self.theta_max_rad, math.atan2(radius, 1.0 + self.k * radius * radius))

    def _radius_from_theta(self, theta: Floats) -> Floats:
        sine, cosine = np.sin(theta), np.cos(theta)
        root = np.sqrt(np.maximum(cosine * cosine - 4.0 * self.k * sine * sine, 0.0))
        behind = cosine < 0.0  # there the other form of the root cancels nothing
        with np.errstate(divide="ignore", invalid="ignore"):
            ahead = 2.0 * sine / (cosine + root)
            back = (cosine - root) / (2.0 * self.k * sine)
        return np.where(behind, back, ahead)

    def _theta_from_radius(self, radius: Floats) -> Floats:
        return np.arctan2(radius, 1.0 + self.k * radius * radius)

    def uniforms(self) -> Uniforms:
        """Values for `shaders/camera/division.glsl`."""
        return {**super().uniforms(), "u_k": self.k, "u_radius_max": self.radius_limits[1]}
