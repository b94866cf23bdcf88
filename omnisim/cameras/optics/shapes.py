"""Shapes of mirrors and boundaries: surfaces of revolution in their own frames.

In a shape's frame, the origin is the vertex, and z points along the axis of revolution, away from a
camera that looks at the shape. A mirror that bulges toward the camera has z > 0 off its axis.
"""

from __future__ import annotations

import dataclasses
import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, ClassVar, Literal, NamedTuple

import numpy as np
import scipy  # its submodules load on first use
from numpy.polynomial.polynomial import polyder, polyval
from pydantic import Field

from omnisim.cameras.camera import CameraParameters
from omnisim.cameras.mirrors.hyperbolic_mirror import (
    PAPER_C,
    PAPER_K,
    PAPER_METERS_PER_UNIT,
    HyperbolicMirror,
)
from omnisim.core.arrays import Bools, Floats
from omnisim.core.errors import OpticsError
from omnisim.core.files.parameters import Number, Parameters, Positive, Signed


class Level(NamedTuple):
    """Implicit function of a shape: 0 on its surface."""

    values: Floats  # (n,)
    gradients: Floats  # (n, 3)


class Shape(ABC):
    """Surface of revolution, bounded only by its own domain; immutable.

    Attributes:
        shape_name: name in files.
        tip_radius_m: radius about the axis within which it has no normal.
        needs_rim: True if it continues beyond the extent of a real mirror.
    """

    shape_name: ClassVar[str]
    tip_radius_m: ClassVar[float] = 0.0
    needs_rim: ClassVar[bool] = False

    @property
    def domain_m(self) -> float:
        """Largest distance from the axis; may be infinite."""
        return math.inf

    def parameters(self) -> CameraParameters:
        """Name and parameters, as written in optics files."""
        assert dataclasses.is_dataclass(self)
        values = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        plain = {k: list(v) if isinstance(v, tuple) else v for k, v in values.items()}
        return {"shape": self.shape_name, **plain}

    @abstractmethod
    def is_convex(self, radius_m: float) -> bool:
        """True if it bulges toward the camera everywhere within a radius."""

    def is_rising(self, radius_m: float) -> bool:
        """True if it recedes from the camera outwards, everywhere within a radius."""
        return self.is_convex(radius_m)

    @abstractmethod
    def intersections(self, origins_m: Floats, directions: Floats, radius_m: float) -> Floats:
        """Lengths (n, m) along rays (n, 3), shape's frame, ascending; NaN: no further crossing.

        Crossings beyond `radius_m` from the axis are irrelevant.
        """

    @abstractmethod
    def level(self, points_m: Floats) -> Level:
        """Implicit function at points (n, 3)."""

    @abstractmethod
    def hessians(self, points_m: Floats) -> Floats:
        """Second derivatives (n, 3, 3) of the implicit function at points (n, 3)."""

    @abstractmethod
    def sag_m(self, radii_m: Floats) -> Floats:
        """Heights z (...) of the surface at radii (...); NaN outside its domain."""


# Quadrics of revolution: A r² + B z² = C z, intersected with rays in closed form.


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


# Profiles z(r) of any form, intersected with rays by bracketing and Newton's method.


_SAMPLES = 25  # samples along a ray, which crosses a surface at most once between two of them
_CONVEXITY_SAMPLES = 2049
_RAYS_PER_BATCH = 1 << 14  # keeps intermediate arrays in the cache
_NEWTON_STEPS = 60
_ROUNDING = 4e-16  # relative rounding error of a length
_SLACK = 0.01  # widens a bracket, as a share of the step between samples
MIN_POINTS, MAX_M = 4, 1e6  # limits of a table
_TINY_M = 1e-12  # distance from the axis below which f'(r)/r becomes f''


class Derivatives(NamedTuple):
    """Profile and its derivatives by r."""

    heights_m: Floats
    slopes: Floats
    curvatures: Floats  # second derivative, 1/m


class Profile(Shape):
    """Surface of revolution with the profile z(r)."""

    @abstractmethod
    def derivatives(self, radii_m: Floats) -> Derivatives:
        """Heights and derivatives at distances (...) from the axis, also slightly out of domain."""

    def is_convex(self, radius_m: float) -> bool:
        """True if no sampled slope or curvature is negative; False if the radius is unbounded."""
        return self._bulge(radius_m) > 0

    def is_rising(self, radius_m: float) -> bool:
        """True if no sampled slope is negative; False if the radius is unbounded."""
        if np.isinf(radius_m):
            return False
        radii_m = np.linspace(0.0, radius_m, _CONVEXITY_SAMPLES)
        return bool((self.derivatives(radii_m).slopes >= 0.0).all())

    def _bulge(self, radius_m: float) -> int:
        """Common sign of sampled slopes and curvatures: 1 or −1, and 0 if they differ."""
        if np.isinf(radius_m):
            return 0
        profile = self.derivatives(np.linspace(0.0, radius_m, _CONVEXITY_SAMPLES))
        signs = np.stack((profile.slopes, profile.curvatures))
        return int((signs >= 0.0).all()) or -int((signs <= 0.0).all())

    def sag_m(self, radii_m: Floats) -> Floats:
        """Heights z(r) (...) at distances r (...) from the axis; NaN outside the domain."""
        return np.where(radii_m <= self.domain_m, self.derivatives(radii_m).heights_m, np.nan)

    def level(self, points_m: Floats) -> Level:
        """Level function z − z(r) at points (n, 3)."""
        radii = np.hypot(points_m[:, 0], points_m[:, 1])
        profile = self.derivatives(radii)
        gradients = np.ones_like(points_m)
        gradients[:, :2] = -points_m[:, :2] * _over_radius(radii, profile)[:, None]
        return Level(points_m[:, 2] - profile.heights_m, gradients)

    def hessians(self, points_m: Floats) -> Floats:
        """Hessians (n, 3, 3): curvature along the meridian, slope over radius across it."""
        radii = np.hypot(points_m[:, 0], points_m[:, 1])
        profile = self.derivatives(radii)
        across = _over_radius(radii, profile)
        outward = points_m[:, :2] / np.maximum(radii, _TINY_M)[:, None]
        hessians = np.zeros((len(points_m), 3, 3))
        along = (profile.curvatures - across)[:, None, None]
        hessians[:, :2, :2] = -along * outward[:, :, None] * outward[:, None, :]
        hessians[:, 0, 0] -= across
        hessians[:, 1, 1] -= across
        return hessians

    def intersections(self, origins_m: Floats, directions: Floats, radius_m: float) -> Floats:
        """Lengths (n, 2) to the first two crossings within the radius; NaN: no crossing."""
        batches = range(0, len(origins_m), _RAYS_PER_BATCH)
        bulge, table = self._bulge(radius_m), HeightTable(self.sag_m, radius_m)
        crossings_m = np.full((len(origins_m), 2), np.nan)
        for rows in (slice(first, first + _RAYS_PER_BATCH) for first in batches):
            near_m, far_m = table.span(origins_m[rows], directions[rows])
            reached = np.flatnonzero(near_m < far_m)  # false for NaN
            o, d = origins_m[rows][reached], directions[rows][reached]
            near_m, far_m = near_m[reached], far_m[reached]
            if bulge:
                ends = (near_m, far_m), (far_m, near_m)
                both = [self._approached(o, d, *interval, bulge) for interval in ends]
                crossings_m[rows][reached] = np.sort(np.stack(both, axis=1), axis=1)
            else:
                crossings_m[rows][reached] = self._crossings_between(o, d, near_m, far_m, table)
        return crossings_m

    def _approached(
        self, origins_m: Floats, directions: Floats, begin_m: Floats, end_m: Floats, bulge: int
    ) -> Floats:
        """First crossings (n,) between two lengths, of a profile that bulges to one side.

        Along a ray, the depth below the surface is a concave function. Outside, its tangents lie
        above it, so Newton's method reaches the nearest crossing without passing it. NaN if the
        interval begins below the surface, or has no crossing.
        """
        crossings_m = np.full(len(begin_m), np.nan)
        rows, at = np.arange(len(begin_m)), begin_m
        forth, before = np.sign(end_m - begin_m), np.full(len(begin_m), np.nan)
        for number in range(_NEWTON_STEPS):
            o, d = origins_m[rows], directions[rows]
            values, gradients = self.level(o + at[:, None] * d)
            depths = bulge * values
            slopes = bulge * forth * np.einsum("nj,nj->n", gradients, d)
            steps = np.divide(-depths, slopes, out=np.zeros_like(at), where=slopes > 0.0)
            at = at + forth * steps
            inside = forth * (end_m[rows] - at) >= 0.0
            arrived = inside & (depths >= 0.0) & (number > 0)  # rounding overshot the crossing
            approaches = inside & (depths < 0.0) & (slopes > 0.0)
            moving = _is_moving(steps, before, at)
            arrived |= approaches & ~moving
            crossings_m[rows[arrived]] = at[arrived]
            kept = approaches & moving
            rows, at, before, forth = rows[kept], at[kept], steps[kept], forth[kept]
            if len(rows) == 0:
                break
        return crossings_m

    def _crossings_between(
        self,
        origins_m: Floats,
        directions: Floats,
        near_m: Floats,
        far_m: Floats,
        table: HeightTable,
    ) -> Floats:
        """First two crossings (n, 2) between two lengths (n,)."""
        steps_m = (far_m - near_m) / (_SAMPLES - 1)
        lengths = near_m + steps_m * np.arange(_SAMPLES)[:, None]
        values = table.heights_above(origins_m, directions, lengths)
        self._find_peaks(origins_m, directions, lengths, values)
        below = values > 0.0
        crossed = below[1:] != below[:-1]
        crossings_m = np.full((len(origins_m), 2), np.nan)
        slack_m = _SLACK * steps_m  # covers the error of the table
        for column in range(2):
            rows = np.flatnonzero(crossed.any(axis=0))
            at = crossed[:, rows].argmax(axis=0)
            crossed[at, rows] = False
            bracket = lengths[at, rows] - slack_m[rows], lengths[at + 1, rows] + slack_m[rows]
            first, second = values[at, rows], values[at + 1, rows]
            share = first / (first - second)
            starts = lengths[at, rows] + share * (lengths[at + 1, rows] - lengths[at, rows])
            sign = np.where(first > 0.0, -1.0, 1.0)
            crossings_m[rows, column] = self._refined(
                origins_m[rows], directions[rows], bracket, starts, sign
            )
        return crossings_m

    def _find_peaks(
        self, origins_m: Floats, directions: Floats, lengths: Floats, values: Floats
    ) -> None:
        """Replace the extreme sample of each ray by the peak of the parabola through it.

        A ray that grazes the limb of a mirror crosses it twice between two samples.
        """
        rows = np.arange(values.shape[1])
        peak = np.clip((values * -np.sign(values[0])).argmax(axis=0), 1, _SAMPLES - 2)
        before, at, after = (values[peak + step, rows] for step in (-1, 0, 1))
        bend = before - 2.0 * at + after
        share = np.divide(before - after, 2.0 * bend, out=np.zeros_like(bend), where=bend != 0.0)
        peak_lengths = lengths[peak, rows] + np.clip(share, -0.999, 0.999) * (
            lengths[1] - lengths[0]
        )
        lengths[peak, rows] = peak_lengths
        values[peak, rows] = self.level(origins_m + peak_lengths[:, None] * directions).values

    def _refined(
        self,
        origins_m: Floats,
        directions: Floats,
        bracket: tuple[Floats, Floats],
        starts: Floats,
        sign: Floats,
    ) -> Floats:
        """Roots (n,) on rays (n, 3) by Newton's method, from starts inside a shrinking bracket.

        `sign` (n,) is that of the values beyond the root.
        """
        low, high = bracket
        lengths = starts.copy()
        active, before = np.arange(len(lengths)), np.full(len(lengths), np.nan)
        for _ in range(_NEWTON_STEPS):
            if len(active) == 0:
                break
            o, d, at = origins_m[active], directions[active], lengths[active]
            values, gradients = self.level(o + at[:, None] * d)
            passed = sign[active] * values > 0.0
            high[active] = np.where(passed, at, high[active])
            low[active] = np.where(passed, low[active], at)
            slopes = np.einsum("nj,nj->n", gradients, d)
            after = at - np.divide(values, slopes, out=np.zeros_like(at), where=slopes != 0.0)
            outside = ~((after >= low[active]) & (after <= high[active])) | (slopes == 0.0)
            after = np.where(outside, 0.5 * (low[active] + high[active]), after)
            lengths[active] = after
            steps = np.abs(after - at)
            moving = _is_moving(steps, before, after) | outside
            active, before = active[moving], steps[moving]
        return lengths


def _is_moving(steps: Floats, before: Floats, lengths: Floats) -> Bools:
    """Mask (n,) of Newton iterations to continue, given that convergence is quadratic."""
    rounding = _ROUNDING * np.abs(lengths)
    return (steps > rounding) & ~(steps**3 <= rounding * before**2)


def _series(coefficients: tuple[float, ...], radii_m: Floats) -> tuple[Floats, Floats, Floats]:
    """Values (n,) of a power series from r⁰ upwards, and of its first two derivatives."""
    orders = (coefficients, polyder(coefficients), polyder(coefficients, 2))
    heights, slopes, curvatures = (
        np.asarray(polyval(radii_m, order), dtype=np.float64) for order in orders
    )
    return heights, slopes, curvatures


def _over_radius(radii: Floats, profile: Derivatives) -> Floats:
    """Ratios f'(r)/r (n,); on the axis their limit f''."""
    near = radii < _TINY_M
    return np.where(near, profile.curvatures, profile.slopes / np.where(near, 1.0, radii))


@dataclass(frozen=True)
class Polynomial(Parameters, Profile, name="shape"):
    """Profile z = Σ aᵢ rⁱ, in meters."""

    shape_name = "polynomial"
    needs_rim = True
    coefficients: Annotated[tuple[Signed, ...], Field(min_length=1, max_length=32)]
    """a₁, a₂, … of r, r², …; the vertex is at z = 0."""

    def derivatives(self, radii_m: Floats) -> Derivatives:
        """The polynomial and its derivatives."""
        return Derivatives(*_series((0.0, *self.coefficients), radii_m))


@dataclass(frozen=True)
class Asphere(Parameters, Profile, name="shape"):
    """Even asphere: a conic plus Σ αᵢ r²ⁱ from r⁴ upwards, in meters."""

    shape_name = "asphere"
    needs_rim = True
    radius_m: Signed
    """Radius of curvature R at the vertex; positive: bulges toward the camera."""
    conic: Annotated[Number, Field(ge=-1e6, le=1e6)] = 0.0
    """Conic constant κ."""
    coefficients: Annotated[tuple[Signed, ...], Field(max_length=16)] = ()
    """α₂, α₃, … of r⁴, r⁶, …"""

    def _check(self) -> None:
        super()._check()
        if abs(self.radius_m) < 1e-9:
            raise self._error("radius_m", "a number of meters other than 0")

    @property
    def domain_m(self) -> float:
        """Radius of the conic's equator; infinite if there is none."""
        return float(np.sqrt(self.radius_m**2 / (1.0 + self.conic))) if self.conic > -1 else np.inf

    def derivatives(self, radii_m: Floats) -> Derivatives:
        """Derivatives of the polynomial plus those of the conic, by w = √(1 − (1 + κ) r²/R²)."""
        curvature = 1.0 / self.radius_m
        inside = 1.0 - (1.0 + self.conic) * (curvature * radii_m) ** 2
        root = np.sqrt(np.maximum(inside, 1e-12))
        even = (0.0, *(term for a in self.coefficients for term in (0.0, a)))
        heights, slopes, curvatures = _series((0.0, 0.0, *even), radii_m)
        return Derivatives(
            curvature * radii_m**2 / (1.0 + root) + heights,
            curvature * radii_m / root + slopes,
            curvature / root**3 + curvatures,
        )


@dataclass(frozen=True, eq=False)
class TabulatedProfile(Profile):
    """Profile through points, by a cubic spline: its curvature is continuous.

    Raises:
        OpticsError: the points do not make a profile.
    """

    shape_name = "table"
    radii_m: Floats  # (n,) radii, ascending from 0
    table_heights_m: Floats  # (n,) heights
    pointed: bool = False  # True if the tip may be conical; False: the profile is level on the axis

    def __post_init__(self) -> None:
        radii_m, heights_m = self.radii_m, self.table_heights_m
        if len(radii_m) < MIN_POINTS:
            raise OpticsError(f"expected at least {MIN_POINTS} points, got {len(radii_m)}")
        if len(heights_m) != len(radii_m):
            message = f"z_m: expected as many numbers as r_m, {len(radii_m)}"
            raise OpticsError(f"{message}, got {len(heights_m)}")
        if not (np.abs((radii_m, heights_m)) <= MAX_M).all():  # also rejects NaN
            raise OpticsError("expected finite numbers in meters")
        if radii_m[0] != 0.0 or not (np.diff(radii_m) > 0.0).all():
            raise OpticsError("r_m: expected numbers that grow from 0")

    @cached_property
    def _coefficients(self) -> Floats:
        """Coefficients of the cubics (4, n − 1), highest power first."""
        begin: Literal["not-a-knot", "clamped"] = "not-a-knot" if self.pointed else "clamped"
        ends = self.radii_m, self.table_heights_m
        return scipy.interpolate.CubicSpline(*ends, bc_type=(begin, "not-a-knot")).c

    @cached_property
    def _is_even(self) -> bool:
        steps_m = np.diff(self.radii_m)
        return bool(np.ptp(steps_m) <= 1e-9 * steps_m[0])

    def parameters(self) -> CameraParameters:
        """Points of the table, and its tip."""
        points = {"r_m": self.radii_m.tolist(), "z_m": self.table_heights_m.tolist()}
        tip = "pointed" if self.pointed else "smooth"
        return {"shape": self.shape_name, **points, "tip": tip}

    @property
    def domain_m(self) -> float:
        """Largest radius of the table."""
        return float(self.radii_m[-1])

    def derivatives(self, radii_m: Floats) -> Derivatives:
        """The spline and its derivatives."""
        last = len(self.radii_m) - 2
        if self._is_even:
            at = (radii_m * ((last + 1) / self.domain_m)).astype(np.intp)
        else:
            at = np.searchsorted(self.radii_m, radii_m, side="right") - 1
        at = np.clip(at, 0, last)
        t = radii_m - self.radii_m.take(at)
        a, b, c, d = (coefficients.take(at) for coefficients in self._coefficients)
        return Derivatives(
            ((a * t + b) * t + c) * t + d, (3.0 * a * t + 2.0 * b) * t + c, 6.0 * a * t + 2.0 * b
        )


# Coarse height table of a profile z(r), to find where rays may cross it.


_STEPS = 1024


class HeightTable:
    """Heights of a profile at equal steps up to a radius, to tell on which side points are."""

    def __init__(self, sag_m: Callable[[Floats], Floats], radius_m: float):
        self._radius_m = radius_m
        self._heights = sag_m(np.linspace(0.0, radius_m, _STEPS + 1))
        self._steps = np.append(np.diff(self._heights), 0.0)
        margin = 1e-3 * (self._heights.max() - self._heights.min()) + 1e-9
        self._low, self._high = self._heights.min() - margin, self._heights.max() + margin

    def heights_above(self, origins_m: Floats, directions: Floats, lengths: Floats) -> Floats:
        """Heights above the surface at lengths (m, n) along rays (n, 3), interpolated linearly."""
        x, y, z = (origins_m[:, axis] + lengths * directions[:, axis] for axis in range(3))
        places = np.sqrt(x * x + y * y)
        places *= _STEPS / self._radius_m
        before = np.minimum(places.astype(np.intp), _STEPS)
        places -= before
        places *= self._steps.take(before)
        z -= self._heights.take(before)
        z -= places
        return z

    def span(self, origins_m: Floats, directions: Floats) -> tuple[Floats, Floats]:
        """Interval of lengths (n,) in which rays (n, 3) are inside the box; NaN: none."""
        low, high = self._low, self._high
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            square = np.sum(directions[:, :2] ** 2, axis=1)
            half = np.sum(directions[:, :2] * origins_m[:, :2], axis=1)
            rest = np.sum(origins_m[:, :2] ** 2, axis=1) - self._radius_m**2
            root = np.sqrt(half * half - square * rest)
            parallel = square == 0.0
            enter = np.where(parallel, np.where(rest <= 0.0, -np.inf, np.nan), -half - root)
            leave = np.where(parallel, np.where(rest <= 0.0, np.inf, np.nan), -half + root)
            enter, leave = (np.where(parallel, x, x / square) for x in (enter, leave))
            ends = (np.array([low, high]) - origins_m[:, 2:]) / directions[:, 2:]
            level = directions[:, 2] == 0.0
            between = (origins_m[:, 2] >= low) & (origins_m[:, 2] <= high)
            bottom = np.where(level, np.where(between, -np.inf, np.nan), ends.min(axis=1))
            top = np.where(level, np.where(between, np.inf, np.nan), ends.max(axis=1))
            near = np.maximum(np.maximum(enter, bottom), 0.0)
            return near, np.minimum(leave, top)
