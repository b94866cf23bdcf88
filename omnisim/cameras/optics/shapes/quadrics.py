"""Quadrics of revolution: A r² + B z² = C z, intersected with rays in closed form."""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import numpy as np
from pydantic import Field

from omnisim.cameras.mirrors.hyperbolic_mirror import (
    PAPER_C,
    PAPER_K,
    PAPER_METERS_PER_UNIT,
    HyperbolicMirror,
)
from omnisim.cameras.optics.shapes.shape import Level, Shape
from omnisim.core.arrays import Floats
from omnisim.core.files.parameters import Number, Parameters, Positive, Signed

_POLISH = 1e-6  # maximum polishing step, as a share of the length


class Quadric(Shape):
    """The sheet of a quadric at its vertex, up to its equator if it has one."""

    @property
    @abstractmethod
    def coefficients(self) -> tuple[float, float, float]:
        """A, B and C ≥ 0 in A r² + B z² = C z; the sheet at the vertex has 2 B z < C."""

    @property
    def domain_m(self) -> float:
        """Radius of the equator; infinite if there is none."""
        a, b, c = self.coefficients
        return 0.5 * c / math.sqrt(a * b) if a * b > 0.0 else math.inf

    def is_convex(self, radius_m: float) -> bool:
        """True if A, whose sign is that of the curvature, is not negative."""
        return self.coefficients[0] >= 0.0

    def intersections(self, origins_m: Floats, directions: Floats, radius_m: float) -> Floats:
        """Both roots (n, 2) of the quadratic, without cancellation, after one Newton step."""
        a, b, c = self.coefficients
        scale = np.array([a, a, b])
        square = np.einsum("nj,j,nj->n", directions, scale, directions)
        half = np.einsum("nj,j,nj->n", directions, scale, origins_m) - 0.5 * c * directions[:, 2]
        rest = np.einsum("nj,j,nj->n", origins_m, scale, origins_m) - c * origins_m[:, 2]
        root = np.full(len(half), np.nan)
        discriminants = half * half - square * rest
        np.sqrt(discriminants, out=root, where=discriminants >= 0.0)
        larger = -(half + np.copysign(root, half))
        lengths = np.stack((_divided(larger, square), _divided(rest, larger)), axis=1)
        for column in range(2):
            roots = lengths[:, column]
            points = origins_m + roots[:, None] * directions
            values, gradients = self.level(points)
            slopes = np.einsum("nj,nj->n", gradients, directions)
            steps = _divided(values, slopes)
            # where a ray is tangent, rounding divided by a zero slope is meaningless
            roots -= np.where(np.abs(steps) <= _POLISH * np.abs(roots), steps, 0.0)
            heights = origins_m[:, 2] + roots * directions[:, 2]
            roots[~(2.0 * b * heights < c)] = np.nan
        return np.sort(lengths, axis=1)

    def level(self, points_m: Floats) -> Level:
        """Level function A r² + B z² − C z."""
        a, b, c = self.coefficients
        half = points_m * (a, a, b)
        values = np.einsum("nj,nj->n", half, points_m) - c * points_m[:, 2]
        return Level(values, 2.0 * half - (0.0, 0.0, c))

    def hessians(self, points_m: Floats) -> Floats:
        """Diagonal Hessians (n, 3, 3) with 2 A, 2 A and 2 B."""
        a, b, _ = self.coefficients
        hessians = np.zeros((len(points_m), 3, 3))
        hessians[:, range(3), range(3)] = 2.0 * a, 2.0 * a, 2.0 * b
        return hessians

    def sag_m(self, radii_m: Floats) -> Floats:
        """Smaller root z of B z² − C z + A r² = 0, without cancellation: 2 A r²/(C + √…)."""
        a, b, c = self.coefficients
        inside = c * c - 4.0 * a * b * radii_m**2
        # at the equator itself, rounding may make the radicand negative
        root = np.sqrt(np.where(radii_m <= self.domain_m, np.maximum(inside, 0.0), np.nan))
        below = c + root
        heights_m: Floats = np.divide(
            2.0 * a * radii_m**2, below, out=np.zeros_like(root), where=below > 0.0
        )
        heights_m[np.isnan(root)] = np.nan
        return heights_m


def _divided(values: Floats, by: Floats) -> Floats:
    return np.divide(values, by, out=np.full(len(by), np.nan), where=by != 0.0)


@dataclass(frozen=True)
class Conic(Parameters, Quadric, name="shape"):
    """Conic of revolution, z = r²/R / (1 + √(1 − (1 + κ) r²/R²))."""

    shape_name = "conic"
    radius_m: Signed
    """Radius of curvature R at the vertex; positive: bulges toward the camera."""
    conic: Annotated[Number, Field(ge=-1e6, le=1e6)] = 0.0
    """Conic constant κ: −e²; 0 is a sphere, −1 a paraboloid, below −1 a hyperboloid."""

    def _check(self) -> None:
        super()._check()
        if abs(self.radius_m) < 1e-9:
            raise self._error("radius_m", "a number of meters other than 0")

    @cached_property
    def coefficients(self) -> tuple[float, float, float]:
        """Coefficients 1/R, (1 + κ)/R and 2."""
        return 1.0 / self.radius_m, (1.0 + self.conic) / self.radius_m, 2.0


@dataclass(frozen=True)
class Hyperbolic(Parameters, Quadric, name="shape"):
    """Hyperboloid of Baker and Nayar, the paper's Eq. 1, with the pinhole at its outer focus."""

    shape_name = "hyperbolic"
    k: Annotated[Number, Field(gt=2.0, le=1e6)] = PAPER_K
    """Parameter k of the profile, dimensionless."""
    c: Positive = PAPER_C
    """Distance from the effective viewpoint to the pinhole, in units of the profile."""
    meters_per_unit: Positive = PAPER_METERS_PER_UNIT
    """Meters per unit of the profile."""

    @property
    def vertex_m(self) -> float:
        """Distance between the vertex and the outer focus."""
        return 0.5 * self.c * self.meters_per_unit + self._mirror.semi_major_axis_m

    @property
    def focal_distance_m(self) -> float:
        """Distance between the foci: from the pinhole to the effective viewpoint."""
        return self._mirror.c_m

    @cached_property
    def _mirror(self) -> HyperbolicMirror:
        return HyperbolicMirror(self.k, self.c, self.meters_per_unit, 1e-3)

    @cached_property
    def coefficients(self) -> tuple[float, float, float]:
        """Coefficients of the conic with R = b²/a and κ = −e²."""
        a_m = self._mirror.semi_major_axis_m
        b_squared_m2 = 0.5 * (self._mirror.c_m**2) / self.k
        radius_m = b_squared_m2 / a_m
        return 1.0 / radius_m, -2.0 / (self.k - 2.0) / radius_m, 2.0


@dataclass(frozen=True)
class Cone(Parameters, Quadric, name="shape"):
    """Cone with its tip toward the camera."""

    shape_name = "cone"
    tip_radius_m = 1e-9
    half_angle_deg: Annotated[Number, Field(ge=1.0, le=89.0)]
    """Angle in degrees between axis and surface: 45 reflects the axis to the horizon."""

    @cached_property
    def coefficients(self) -> tuple[float, float, float]:
        """Coefficients 1, −tan² and 0."""
        return 1.0, -(math.tan(math.radians(self.half_angle_deg)) ** 2), 0.0

    def sag_m(self, radii_m: Floats) -> Floats:
        """Heights z (...) at radii r (...): r over the tangent of the half angle."""
        return radii_m / math.tan(math.radians(self.half_angle_deg))


@dataclass(frozen=True)
class Plane(Parameters, Quadric, name="shape"):
    """A plane."""

    shape_name = "plane"

    @property
    def coefficients(self) -> tuple[float, float, float]:
        """Coefficients 0, 0 and 1."""
        return 0.0, 0.0, 1.0
