"""Base of models whose radius is a polynomial of θ."""

from __future__ import annotations

import math
from abc import abstractmethod
from functools import cached_property

from numpy.polynomial import polynomial

from omnisim.cameras.monotone import first_root, polyval, solve_polynomial
from omnisim.cameras.plane_camera import RadialCamera
from omnisim.core.arrays import Floats


class PolynomialLens(RadialCamera):
    """Lens r(θ) = Σ aₙ θⁿ with r(0) = 0, increasing up to the fold, the first θ where dr/dθ = 0.

    Domain: 0 ≤ θ ≤ min(θ_max, θ_fold).
    """

    theta_max_rad: float

    @property
    @abstractmethod
    def theta_polynomial(self) -> tuple[float, ...]:
        """Coefficients of r(θ), a₀ = 0 first."""

    @cached_property
    def fold_rad(self) -> float:
        """Angle of the fold; 2π if there is none below 2π."""
        return first_root(polynomial.polyder(self.theta_polynomial), math.tau)

    @property
    def theta_edge_rad(self) -> float:
        """Angle from the axis where the domain ends: θ_max, or the fold before it."""
        return min(self.theta_max_rad, self.fold_rad)

    def _radius_from_theta(self, theta: Floats) -> Floats:
        return polyval(self.theta_polynomial, theta)

    def _theta_from_radius(self, radius: Floats) -> Floats:
        return solve_polynomial(self.theta_polynomial, radius, 0.0, self.theta_edge_rad)
