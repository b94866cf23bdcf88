"""F-theta lens: the radius in pixels is a polynomial of the angle.

    r = k1 θ + k2 θ² + … + kn θⁿ, in pixels along u; along v times the aspect ratio
    (u, v) = [[c, d], [e, 1]] r (cos φ, sin φ) + (u0, v0), for square pixels

Domain: 0 ≤ θ ≤ min(θ_max, θ_fold), θ_fold the first θ > 0 with dr/dθ = 0. `f_theta_inverse` is the
opposite model, with θ as a polynomial of r.

GLSL twin: `shaders/camera/f_theta.glsl`. Source: NVIDIA's f-theta lens with k0 = 0; WoodScape's
calibration files (Yogamani et al., 2019), four coefficients.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from omnisim.cameras.camera import Uniforms
from omnisim.cameras.lens_polynomials import PolynomialLens
from omnisim.cameras.parametric_camera import (
    Affine,
    AffineCamera,
    Coefficients,
    PrincipalPoint,
    ThetaMax,
)
from omnisim.core.arrays import Floats
from omnisim.core.files.parameters import Number, Typical

ASPECT_RATIOS = (0.1, 10.0)
MAX_COEFFICIENTS = 8  # u_coefficients of the GLSL twin


@dataclass(frozen=True)
class FThetaCamera(AffineCamera, PolynomialLens):
    """Fisheye lens whose radius is a polynomial of the angle."""

    principal_point_px: PrincipalPoint
    """(u, v) of the optical axis in the image; typically its center."""
    coefficients_px: Annotated[Coefficients, Field(min_length=1, max_length=MAX_COEFFICIENTS)]
    """k1 … kn of θ, θ², …, at most 8; k1 > 0 is the focal length."""
    theta_max_rad: Annotated[ThetaMax, Typical(math.radians(95.0), math.radians(110.0))] = math.pi
    """Angle from the axis where the domain ends, unless the fold comes first."""
    aspect_ratio: Annotated[Number, Field(ge=ASPECT_RATIOS[0], le=ASPECT_RATIOS[1])] = 1.0
    """Pixels along v per pixel along u at the same radius; 1: square pixels."""
    affine: Affine = (1.0, 0.0, 0.0)
    """c, d, e of the affine map; typically 1, 0, 0."""
    model_name = "f_theta"
    added_later = frozenset({"aspect_ratio", "affine"})

    def _check(self) -> None:
        super()._check()
        if self.coefficients_px[0] <= 0.0:
            raise self._error("coefficients_px", "numbers, the first of them more than 0")
        if self.affine[0] - self.affine[1] * self.affine[2] <= 0.0:
            raise self._error("affine", "c, d, e with c > d e")

    @property
    def pixels_from_axes(self) -> Floats:
        """Matrix (2, 2) from the plane, in pixels along u, to (u, v)."""
        c, d, e = self.affine
        return np.array([[c, d], [e * self.aspect_ratio, self.aspect_ratio]])

    @property
    def pixels_per_plane(self) -> tuple[float, float]:
        """Pixels per unit of the plane, which is measured in pixels along u."""
        return 1.0, self.aspect_ratio

    @property
    def theta_polynomial(self) -> tuple[float, ...]:
        """Coefficients of r(θ), θ⁰ first."""
        return (0.0, *self.coefficients_px)

    def uniforms(self) -> Uniforms:
        """Values for `shaders/camera/f_theta.glsl`."""
        missing = MAX_COEFFICIENTS - len(self.coefficients_px)
        return {
            **super().uniforms(),
            "u_coefficients_px": self.coefficients_px + (0.0,) * missing,
            "u_theta_edge_rad": self.theta_edge_rad,
            "u_radius_max_px": self.radius_limits[1],
        }
