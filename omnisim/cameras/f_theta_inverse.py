"""Inverse f-theta lens: the angle is a polynomial of the radius in pixels.

    θ = k1 r + k2 r² + … + kn rⁿ, r in pixels around the principal point
    (u, v) = [[c, d], [e, 1]] r (cos φ, sin φ) + (u0, v0)

Domain: 0 ≤ θ ≤ θ_max and r before the first radius where dθ/dr has fallen to a thousandth of k1.
Beyond it, many pixels share nearly the same ray, and the inverse is ill-conditioned. `f_theta` is
the opposite model, with r as a polynomial of θ.

GLSL twin: `shaders/camera/f_theta_inverse.glsl`. Source: NVIDIA's f-theta lens, pixel to angle,
with k0 = 0.
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
from omnisim.cameras.lens_polynomials import MAX_RADIUS_PX, first_root, polyval, solve_polynomial
from omnisim.cameras.parametric_camera import (
    Affine,
    AffineCamera,
    Coefficients,
    PrincipalPoint,
    RadialCamera,
    WideTheta,
)
from omnisim.core.arrays import Floats

MAX_COEFFICIENTS = 8  # u_coefficients of the GLSL twin
MIN_SLOPE = 1e-3  # share of the slope at the axis


@dataclass(frozen=True)
class FThetaInverseCamera(AffineCamera, RadialCamera):
    """Fisheye lens whose angle is a polynomial of the radius."""

    principal_point_px: PrincipalPoint
    """(u, v) of the optical axis in the image; typically its center."""
    coefficients: Annotated[Coefficients, Field(min_length=1, max_length=MAX_COEFFICIENTS)]
    """k1 … kn of r, r², …, at most 8; k1 > 0."""
    theta_max_rad: WideTheta = math.pi
    """Angle from the axis where the domain ends."""
    affine: Affine = (1.0, 0.0, 0.0)
    """c, d, e of the affine map; typically 1, 0, 0."""
    model_name = "f_theta_inverse"
    added_later = frozenset({"affine"})
    pixels_per_plane = 1.0  # the plane is in pixels

    def scaled(self, scale: float) -> FThetaInverseCamera:
        """The same view in an image `scale` times as large; sizes are rounded."""
        powers = range(1, 1 + len(self.coefficients))
        shrunk = tuple(k / scale**n for k, n in zip(self.coefficients, powers, strict=True))
        return dataclasses.replace(super().scaled(scale), coefficients=shrunk)

    def _check(self) -> None:
        super()._check()
        if self.coefficients[0] <= 0.0:
            raise self._error("coefficients", "numbers, the first of them more than 0")
        if self.affine[0] - self.affine[1] * self.affine[2] <= 0.0:
            raise self._error("affine", "c, d, e with c > d e")

    @property
    def pixels_from_axes(self) -> Floats:
        """Matrix (2, 2) from the plane to (u, v), both in pixels."""
        return np.array([self.affine[:2], (self.affine[2], 1.0)])

    @cached_property
    def radius_max_px(self) -> float:
        """Radius where the domain ends."""
        thetas = np.array([0.0, *self.coefficients])
        slopes = polynomial.polyder(thetas)
        slopes[0] *= 1.0 - MIN_SLOPE
        thetas[0] = -self.theta_max_rad
        end = first_root(thetas, MAX_RADIUS_PX)
        return first_root(slopes, end)

    @property
    def theta_edge_rad(self) -> float:
        """Angle from the axis where the domain ends."""
        return min(self.theta_max_rad, float(self._theta(np.array(self.radius_max_px))))

    def _theta(self, radius: Floats) -> Floats:
        return polyval((0.0, *self.coefficients), radius)

    def _theta_from_radius(self, radius: Floats) -> Floats:
        return np.minimum(self._theta(radius), self.theta_edge_rad)

    def _radius_from_theta(self, theta: Floats) -> Floats:
        return solve_polynomial((0.0, *self.coefficients), theta, 0.0, self.radius_max_px)

    def uniforms(self) -> Uniforms:
        """Values for `shaders/camera/f_theta_inverse.glsl`, scaled to r/r_max for precision."""
        powers = range(1, MAX_COEFFICIENTS + 1)
        coefficients = self.coefficients + (0.0,) * (MAX_COEFFICIENTS - len(self.coefficients))
        return {
            **super().uniforms(),
            "u_coefficients": tuple(
                k * self.radius_max_px**n for k, n in zip(coefficients, powers, strict=True)
            ),
            "u_radius_max_px": self.radius_max_px,
        }
