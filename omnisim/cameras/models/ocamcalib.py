"""Scaramuzza's polynomial model, as in OCamCalib's calib_results.txt.

With x' down the rows, y' along the columns, ρ = √(x'² + y'²) and F(ρ) = a0 + a1 ρ + … + aN ρᴺ:

    (row, column) = [[c, d], [e, 1]] (x', y') + (center's row, column)
    the toolbox's ray is (x', y', F(ρ)) and looks along −z, so omnisim's is (y', x', −F(ρ))
    θ = atan2(ρ, −F(ρ))

The principal point here is (column, row), counted from 0. Files count rows and columns from 1 if
MATLAB wrote them, and from 0 if the C version did.

Domain: 0 ≤ θ ≤ θ_max, and ρ before the first ρ where dθ/dρ = (ρ F' − F)/(ρ² + F²) has fallen to a
thousandth of the axis's −1/a0. Beyond it, many pixels share nearly the same ray. The inverse is
numerical.

GLSL twin: `shaders/camera/ocamcalib.glsl`. Source: Scaramuzza, Martinelli & Siegwart, "A toolbox
for easily calibrating omnidirectional cameras", 2006.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import numpy as np
from numpy.polynomial import polynomial
from pydantic import Field

from omnisim.cameras.camera import Uniforms
from omnisim.cameras.lens_polynomials import MAX_RADIUS_PX, first_root, polyval, solve_increasing
from omnisim.cameras.parametric_camera import (
    Affine,
    AffineCamera,
    PrincipalPoint,
    RadialCamera,
    WideTheta,
)
from omnisim.core.arrays import Floats
from omnisim.core.files.parameters import Signed

MAX_COEFFICIENTS = 8  # u_polynomial of the GLSL twin
MIN_SLOPE = 1e-3  # share of the slope at the axis


@dataclass(frozen=True)
class OcamcalibCamera(AffineCamera, RadialCamera):
    """Mirror or fisheye lens with a polynomial along the axis."""

    principal_point_px: PrincipalPoint
    """(u, v) of the optical axis in the image; typically its center."""
    polynomial: Annotated[tuple[Signed, ...], Field(min_length=1, max_length=MAX_COEFFICIENTS)]
    """a0 … aN, N at most 7; typically a0 = −200, a1 = 0 and a2 = 1e-3."""
    affine: Affine = (1.0, 0.0, 0.0)
    """c, d, e of the affine map; typically 1, 0, 0."""
    theta_max_rad: WideTheta = math.pi
    """Angle from the axis where the domain ends."""
    model_name = "ocamcalib"
    pixels_per_plane = 1.0  # the plane is in pixels

    def scaled(self, scale: float) -> OcamcalibCamera:
        """The same view in an image `scale` times as large; sizes are rounded."""
        # z and ρ are both in pixels
        grown = tuple(a * scale ** (1 - n) for n, a in enumerate(self.polynomial))
        return dataclasses.replace(super().scaled(scale), polynomial=grown)

    def _check(self) -> None:
        super()._check()
        if self.polynomial[0] >= 0.0:
            raise self._error("polynomial", "coefficients with a0 < 0")
        if self.affine[0] - self.affine[1] * self.affine[2] <= 0.0:
            raise self._error("affine", "c, d, e with c > d e")

    @cached_property
    def _rises(self) -> Floats:
        """Coefficients of the polynomial's derivative."""
        return np.asarray(polynomial.polyder(self.polynomial), dtype=np.float64)

    @cached_property
    def radius_max_px(self) -> float:
        """Largest ρ of the domain."""
        heights = np.array(self.polynomial)
        rises = polynomial.polysub(polynomial.polymulx(self._rises), heights)
        squares = polynomial.polyadd([0.0, 0.0, 1.0], polynomial.polymul(heights, heights))
        least = MIN_SLOPE / -heights[0]
        end = first_root(polynomial.polysub(rises, least * squares), MAX_RADIUS_PX)
        # sin(θ_max) F(ρ) + cos(θ_max) ρ = 0 at θ_max
        sine, cosine = math.sin(self.theta_max_rad), math.cos(self.theta_max_rad)
        at_theta_max = polynomial.polyadd(sine * heights, [0.0, cosine])
        return end if self.theta_max_rad == math.pi else min(end, first_root(at_theta_max, end))

    @property
    def theta_edge_rad(self) -> float:
        """Angle from the axis where the domain ends."""
        return min(self.theta_max_rad, float(self._theta(np.array(self.radius_max_px))))

    def _theta(self, radius: Floats) -> Floats:
        return np.arctan2(radius, -polyval(self.polynomial, radius))

    def _slope(self, radius: Floats) -> Floats:
        height = polyval(self.polynomial, radius)
        rise = polyval(self._rises, radius)
        return (radius * rise - height) / (radius * radius + height * height)

    def _theta_from_radius(self, radius: Floats) -> Floats:
        return np.minimum(self._theta(radius), self.theta_edge_rad)

    def _radius_from_theta(self, theta: Floats) -> Floats:
        return solve_increasing(self._theta, self._slope, theta, 0.0, self.radius_max_px)

    @property
    def pixels_from_axes(self) -> Floats:
        """Matrix (2, 2) from (y', x') to (column, row)."""
        c, d, e = self.affine
        return np.array([[1.0, e], [d, c]])

    def uniforms(self) -> Uniforms:
        """Values for `shaders/camera/ocamcalib.glsl`, scaled to ρ/ρ_max for precision."""
        scale = self.radius_max_px
        coefficients = self.polynomial + (0.0,) * (MAX_COEFFICIENTS - len(self.polynomial))
        return {
            **super().uniforms(),
            "u_polynomial": tuple(a * scale ** (n - 1) for n, a in enumerate(coefficients)),
            "u_radius_max_px": scale,
        }
