"""Hyperbolic mirror of Baker and Nayar, the paper's Eq. 1.

In the mirror frame, the effective viewpoint is the origin, the pinhole of the camera is at
(0, 0, c), and z points from the viewpoint to the pinhole. θ is the angle of incidence, measured at
the effective viewpoint from +z: 0 looks at the pinhole, π/2 is the plane of the horizon.

All formulas are in k and c. The eccentricity is avoided, because it is infinite for k = 2 (the
plane mirror, the limit of the family).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from omnisim.core.arrays import Bools, Floats
from omnisim.core.errors import OpticsError
from omnisim.core.files.parameters import AboveZero, Number, Parameters

PAPER_K = 11.546
PAPER_C = 2.321
PAPER_METERS_PER_UNIT = 0.04  # an assumption: the paper gives no unit
DEFAULT_RIM_RAD = math.radians(105.0)  # an assumption: the paper gives no rim
MAX_K = 1e6  # a paraboloid to within a millionth; beyond it rounding begins to show
MIN_C_M, MAX_C_M = 1e-6, 1e6


class SurfacePoints(NamedTuple):
    """Points on the mirror; valid up to the rim, NaN beyond the asymptote."""

    positions_m: Floats  # (..., 3), mirror frame
    valid: Bools  # (...,)


@dataclass(frozen=True)
class HyperbolicMirror(Parameters, name="mirror"):
    """A hyperboloid of revolution with one effective viewpoint, cut off at a rim.

    Source: Baker & Nayar, "A theory of single-viewpoint catadioptric image formation", 1999;
    Schmits & Visser 2008, Eq. 1.
    """

    k: Annotated[Number, Field(ge=2.0, le=MAX_K)] = PAPER_K
    """Parameter k of the profile, Eq. 1, dimensionless; 2 is the plane mirror."""
    c: AboveZero = PAPER_C
    """Distance from the effective viewpoint to the pinhole, in units of the profile."""
    meters_per_unit: AboveZero = PAPER_METERS_PER_UNIT
    """Meters per unit of the profile; the paper names none: an assumption."""
    theta_max_rad: AboveZero = DEFAULT_RIM_RAD
    """Incidence angle of the rim from straight down; 90° is the horizon, and the limit is below the
    mirror's asymptote. An assumption: the paper names none."""

    def _check(self) -> None:
        if not MIN_C_M <= self.c_m <= MAX_C_M:
            raise OpticsError(
                f"mirror: c · meters_per_unit: expected {MIN_C_M:g} to {MAX_C_M:g} m, "
                f"got {self.c_m:g} m"
            )
        if not self.theta_max_rad < self.theta_limit_rad:
            raise OpticsError(
                "mirror: rim: expected less than the asymptote of "
                f"k = {self.k:g}, {math.degrees(self.theta_limit_rad):.3f}°, "
                f"got {math.degrees(self.theta_max_rad):.6g}°"
            )

    @classmethod
    def with_rim_radius(
        cls,
        rim_radius_m: float,
        k: float = PAPER_K,
        c: float = PAPER_C,
        meters_per_unit: float = PAPER_METERS_PER_UNIT,
    ) -> HyperbolicMirror:
        """Build a mirror whose rim has a radius of `rim_radius_m` meters.

        Raises:
            OpticsError: a radius ≤ 0, or any value that the constructor rejects.
        """
        if not 0.0 < rim_radius_m <= MAX_C_M:
            raise OpticsError(
                f"mirror: rim_radius_m: expected more than 0 and at most {MAX_C_M:g}, "
                f"got {rim_radius_m:g}"
            )
        unbounded = cls(k, c, meters_per_unit, 1e-3)  # checks k, c and the scale first
        height_m = float(unbounded.height_from_radius_m(rim_radius_m))
        return cls(k, c, meters_per_unit, math.atan2(rim_radius_m, height_m))

    @property
    def c_m(self) -> float:
        """Distance from the effective viewpoint to the pinhole."""
        return self.c * self.meters_per_unit

    @property
    def semi_major_axis_m(self) -> float:
        """Semi-axis a along z: (c/2)√((k−2)/k)."""
        return 0.5 * self.c_m * math.sqrt((self.k - 2.0) / self.k)

    @property
    def semi_minor_axis_m(self) -> float:
        """Semi-axis b across z: (c/2)√(2/k)."""
        return 0.5 * self.c_m * math.sqrt(2.0 / self.k)

    @property
    def eccentricity(self) -> float:
        """Eccentricity e = √(k/(k−2)), infinite for the plane mirror."""
        return math.inf if self.k == 2.0 else math.sqrt(self.k / (self.k - 2.0))

    @property
    def xi(self) -> float:
        """ξ of the unified (Geyer, Mei) model: √(k(k−2))/(k−1); a paraboloid would have 1."""
        return self._s / (self.k - 1.0)

    @property
    def half_angle_ratio(self) -> float:
        """K in tan(θ/2) = K tan(β/2), with β the angle at the pinhole: k − 1 + √(k(k−2))."""
        return self.k - 1.0 + self._s

    @property
    def vertex_height_m(self) -> float:
        """Height z of the mirror's vertex above the effective viewpoint: c/2 − a."""
        return 0.5 * self.c_m - self.semi_major_axis_m

    @property
    def theta_limit_rad(self) -> float:
        """Incidence of the asymptote, acos(−1/e), which no rim can reach."""
        return math.acos(-math.sqrt((self.k - 2.0) / self.k))

    @property
    def rim_radius_m(self) -> float:
        """Radius of the rim."""
        return float(self.rho_m(self.theta_max_rad)) * math.sin(self.theta_max_rad)

    @property
    def rim_height_m(self) -> float:
        """Height z of the rim; negative if the mirror sees above the horizon."""
        return float(self.rho_m(self.theta_max_rad)) * math.cos(self.theta_max_rad)

    def rho_m(self, theta_rad: ArrayLike) -> Floats:
        """Distance (...,) from the effective viewpoint to the surface; NaN beyond the asymptote.

        Source: polar form of Eq. 1 about the focus, ρ = c/(√(k(k−2)) + k cos θ).
        """
        theta = np.asarray(theta_rad, dtype=np.float64)
        denominator = self._s + self.k * np.cos(theta)
        exists = denominator > 0.0
        rho = np.full(theta.shape, np.nan)
        np.divide(self.c_m, denominator, out=rho, where=exists)
        return rho

    def surface_points(self, theta_rad: ArrayLike, azimuth_rad: ArrayLike) -> SurfacePoints:
        """Points (..., 3) in the mirror frame; θ and azimuth (...,) broadcast.

        Azimuth is counted from the mirror's +x toward its +y. Valid for 0 ≤ θ ≤ θ_max.
        """
        theta, azimuth = np.broadcast_arrays(
            np.asarray(theta_rad, dtype=np.float64), np.asarray(azimuth_rad, dtype=np.float64)
        )
        rho = self.rho_m(theta)
        sin_theta = np.sin(theta)
        x, y = rho * sin_theta * np.cos(azimuth), rho * sin_theta * np.sin(azimuth)
        positions = np.stack((x, y, rho * np.cos(theta)), axis=-1)
        valid = (theta >= 0.0) & (theta <= self.theta_max_rad)
        return SurfacePoints(positions, valid)

    def height_from_radius_m(self, radius_m: ArrayLike) -> Floats:
        """Height z (...,) of the surface at a distance (...,) from the axis, in meters."""
        radius = np.asarray(radius_m, dtype=np.float64)
        a = self.semi_major_axis_m
        # c/2 − √(a² + r²(k/2 − 1)), on the branch of the effective viewpoint
        return 0.5 * self.c_m - np.sqrt(a * a + radius * radius * (0.5 * self.k - 1.0))

    def tangent_from_theta(self, theta_rad: ArrayLike) -> Floats:
        """Tangent (...,) of the angle β at the pinhole that corresponds to incidence θ (...,).

        The exact image radius is this tangent times the focal length. The tangent is infinite or
        negative where no ray of the pinhole can see θ; the rim bounds the domain, see
        `theta_max_rad`.

        Source: tan(β/2) = tan(θ/2)/K with K = k − 1 + √(k(k−2)), from the polar forms of Eq. 1
        about its two foci; the same relation as tan β = sin θ/(√(k(k−2)) + (k−1) cos θ).
        """
        theta = np.asarray(theta_rad, dtype=np.float64)
        half = np.tan(0.5 * theta) / self.half_angle_ratio
        return 2.0 * half / (1.0 - half * half)

    def theta_from_tangent(self, tangent: ArrayLike) -> Floats:
        """Incidence θ (...,) of the pinhole ray whose angle to the axis has this tangent (...,).

        Source: the inverse of `tangent_from_theta`.
        """
        t = np.asarray(tangent, dtype=np.float64)
        half = t / (1.0 + np.sqrt(1.0 + t * t))
        return 2.0 * np.arctan(self.half_angle_ratio * half)

    def equation_residual(self, positions_m: ArrayLike) -> Floats:
        """Left side minus right side of Eq. 1, relative to c²; (..., 3) → (...,)."""
        positions = np.asarray(positions_m, dtype=np.float64) / self.c_m
        radius_squared = positions[..., 0] ** 2 + positions[..., 1] ** 2
        left = (positions[..., 2] - 0.5) ** 2 - radius_squared * (0.5 * self.k - 1.0)
        return left - 0.25 * (self.k - 2.0) / self.k

    def normals(self, positions_m: ArrayLike) -> Floats:
        """Unit normals (..., 3) on the reflecting side, at points (..., 3) of the surface.

        Source: the gradient of Eq. 1, oriented toward the pinhole. The gradient of the plane
            mirror vanishes; its normal is +z.
        """
        positions = np.asarray(positions_m, dtype=np.float64) / self.c_m
        gradient = np.empty_like(positions)
        gradient[..., :2] = positions[..., :2] * (0.5 * self.k - 1.0)
        gradient[..., 2] = 0.5 - positions[..., 2]
        if self.k == 2.0:
            gradient[..., 2] = 1.0
        gradient /= np.linalg.norm(gradient, axis=-1, keepdims=True)
        return gradient

    @property
    def _s(self) -> float:
        return math.sqrt(self.k * (self.k - 2.0))
