"""Polynomial fisheye of Kannala and Brandt: OpenCV's `fisheye`, Kalibr's `equidistant`.

    θ = atan2(√(x² + y²), z)
    θ_d = θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸)
    (u, v) = (fx θ_d cos φ + s θ_d sin φ + cx, fy θ_d sin φ + cy)

Domain: 0 ≤ θ ≤ min(θ_max, θ_fold), where θ_fold is the first θ > 0 with dθ_d/dθ = 0: there the
image would fold over itself. The model is right beyond 90°; OpenCV's own is not, because it takes θ
from x/z.

GLSL twin: `shaders/camera/kannala_brandt.glsl`. Source: Kannala & Brandt, "A generic camera model
and calibration method for conventional, wide-angle, and fish-eye lenses", 2006; OpenCV's module
calib3d.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from omnisim.cameras.camera import Uniforms
from omnisim.cameras.lens_polynomials import PolynomialLens
from omnisim.cameras.parametric_camera import Coefficients, SkewedCamera, WideTheta
from omnisim.core.files.parameters import Number, described


@dataclass(frozen=True)
class KannalaBrandtCamera(SkewedCamera, PolynomialLens):
    """Fisheye lens with an odd polynomial of θ."""

    coefficients: Annotated[
        Coefficients, Field(min_length=4, max_length=4), described("k1, k2, k3, k4")
    ]
    """k1, k2, k3, k4 of θ³, θ⁵, …; typically below 0.1."""
    theta_max_rad: WideTheta = math.pi
    """Angle from the axis where the domain ends, unless the fold comes first."""
    skew_px: Number = 0.0
    """Skew s, OpenCV's fx α."""
    model_name = "kannala_brandt"
    added_later = frozenset({"skew_px"})

    @property
    def theta_polynomial(self) -> tuple[float, ...]:
        """Coefficients of θ_d(θ), from θ⁰ to θ⁹."""
        k1, k2, k3, k4 = self.coefficients
        return (0.0, 1.0, 0.0, k1, 0.0, k2, 0.0, k3, 0.0, k4)

    def uniforms(self) -> Uniforms:
        """Values for `shaders/camera/kannala_brandt.glsl`."""
        return {
            **super().uniforms(),
            "u_coefficients": self.coefficients,
            "u_theta_edge_rad": self.theta_edge_rad,
            "u_radius_max": self.radius_limits[1],
        }
