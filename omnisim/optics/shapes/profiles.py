"""Profiles z(r) of any form, where rays are cut by bracketing and Newton's method."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple

import numpy as np
import scipy  # its submodules load when first used
from numpy.polynomial.polynomial import polyder, polyval
from numpy.typing import NDArray
from pydantic import Field

from omnisim.optics.shapes.shape import Floats, Level, Shape
from omnisim.parameters import Number, Parameters, Signed

_SAMPLES = 25  # along a ray, between which a surface is crossed once at most
_CONVEXITY_SAMPLES = 2049
_RAYS_PER_BATCH = 1 << 14  # intermediate arrays stay in the cache
_NEWTON_STEPS = 60
_TINY_M = 1e-12  # from the axis, where f'(r)/r becomes f''


class Derivatives(NamedTuple):
    """Profile and its derivatives by r."""

    heights_m: Floats
    slopes: Floats
    curvatures: Floats  # second derivative, 1/m


class Profile(Shape):
    """A surface of revolution about its profile z(r)."""

    @abstractmethod
    def derivatives(self, radii_m: Floats) -> Derivatives:
        """Profile at distances from the axis, also somewhat beyond its domain."""

    def heights_m(self, radii_m: Floats) -> Floats:
        """Profile without its derivatives."""
        return self.derivatives(radii_m).heights_m

    def is_convex(self, radius_m: float) -> bool:
        """Signs of slope and curvature at samples; not, where the radius has no bound."""
        if np.isinf(radius_m):
            return False
        profile = self.derivatives(np.linspace(0.0, radius_m, _CONVEXITY_SAMPLES))
        return bool((profile.slopes >= 0.0).all() and (profile.curvatures > 0.0).all())

    def sag_m(self, radii_m: Floats) -> Floats:
        """z(r) in its domain."""
        return np.where(radii_m <= self.domain_m, self.heights_m(radii_m), np.nan)

    def level(self, points_m: Floats) -> Level:
        """z − z(r)."""
        radii = np.hypot(points_m[:, 0], points_m[:, 1])
        profile = self.derivatives(radii)
        gradients = np.ones_like(points_m)
        gradients[:, :2] = -points_m[:, :2] * _over_radius(radii, profile)[:, None]
        return Level(points_m[:, 2] - profile.heights_m, gradients)

    def hessians(self, points_m: Floats) -> Floats:
        """Curvature along the meridian, slope over radius across it."""
        radii = np.hypot(points_m[:, 0], points_m[:, 1])
        profile = self.derivatives(radii)
        across = _over_radius(radii, profile)
        outward = points_m[:, :2] / np.maximum(radii, _TINY_M)[:, None]
        found = np.zeros((len(points_m), 3, 3))
        along = (profile.curvatures - across)[:, None, None]
        found[:, :2, :2] = -along * outward[:, :, None] * outward[:, None, :]
        found[:, 0, 0] -= across
        found[:, 1, 1] -= across
        return found

    def intersections(self, origins_m: Floats, directions: Floats, radius_m: float) -> Floats:
        """First two crossings within the radius."""
        batches = range(0, len(origins_m), _RAYS_PER_BATCH)
        found = [
            self._crossings(origins_m[first:last], directions[first:last], radius_m)
            for first, last in ((first, first + _RAYS_PER_BATCH) for first in batches)
        ]
        return np.concatenate([np.empty((0, 2)), *found])

    def _crossings(self, origins_m: Floats, directions: Floats, radius_m: float) -> Floats:
        near_m, far_m = self._span(origins_m, directions, radius_m)
        found = np.full((len(origins_m), 2), np.nan)
        reached = np.flatnonzero(np.isfinite(near_m + far_m))
        found[reached] = self._crossings_between(
            origins_m[reached], directions[reached], near_m[reached], far_m[reached]
        )
        return found

    def _crossings_between(
        self, origins_m: Floats, directions: Floats, near_m: Floats, far_m: Floats
    ) -> Floats:
        """First two crossings (n, 2) between two lengths (n,)."""
        shares = np.linspace(0.0, 1.0, _SAMPLES)
        lengths = near_m[:, None] + (far_m - near_m)[:, None] * shares
        values = self._along(origins_m, directions, lengths)
        lengths, values = self._with_peaks(origins_m, directions, lengths, values)
        inside = values > 0.0
        crossed = inside[:, 1:] != inside[:, :-1]
        found = np.full((len(origins_m), 2), np.nan)
        for column in range(2):
            rows = np.flatnonzero(crossed.any(axis=1))
            at = crossed[rows].argmax(axis=1)
            crossed[rows, at] = False
            found[rows, column] = self._refined(
                origins_m[rows], directions[rows], lengths[rows, at], lengths[rows, at + 1]
            )
        return found

    def _span(
        self, origins_m: Floats, directions: Floats, radius_m: float
    ) -> tuple[Floats, Floats]:
        """Lengths (n,) between which rays are in the box of the profile; NaN: nowhere."""
        heights = self.heights_m(np.linspace(0.0, radius_m, 129))
        margin = 1e-3 * (heights.max() - heights.min()) + 1e-9
        low, high = heights.min() - margin, heights.max() + margin
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            square = np.sum(directions[:, :2] ** 2, axis=1)
            half = np.sum(directions[:, :2] * origins_m[:, :2], axis=1)
            rest = np.sum(origins_m[:, :2] ** 2, axis=1) - radius_m**2
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
            far = np.minimum(leave, top)
            return np.where(near < far, near, np.nan), np.where(near < far, far, np.nan)

    def _along(self, origins_m: Floats, directions: Floats, lengths: Floats) -> Floats:
        """Heights above the surface, at lengths (n, m) or (n,) of rays (n, 3)."""
        flat = lengths if lengths.ndim == 2 else lengths[:, None]
        x, y, z = (origins_m[:, axis, None] + flat * directions[:, axis, None] for axis in range(3))
        return (z - self.heights_m(np.sqrt(x * x + y * y))).reshape(lengths.shape)

    def _with_peaks(
        self, origins_m: Floats, directions: Floats, lengths: Floats, values: Floats
    ) -> tuple[Floats, Floats]:
        """Replace the sample at each ray's extreme by the peak of the parabola through it.

        A ray that cuts the limb of a mirror crosses it twice between two samples.
        """
        rows = np.arange(len(values))
        peak = np.clip((values * -np.sign(values[:, :1])).argmax(axis=1), 1, _SAMPLES - 2)
        before, at, after = (values[rows, peak + step] for step in (-1, 0, 1))
        bend = before - 2.0 * at + after
        share = np.divide(before - after, 2.0 * bend, out=np.zeros_like(bend), where=bend != 0.0)
        step_m = lengths[rows, 1] - lengths[rows, 0]
        there = lengths[rows, peak] + np.clip(share, -0.999, 0.999) * step_m
        lengths[rows, peak] = there
        values[rows, peak] = self._along(origins_m, directions, there)
        return lengths, values

    def _refined(self, origins_m: Floats, directions: Floats, low: Floats, high: Floats) -> Floats:
        """Roots (n,) between two lengths, by Newton's method inside a shrinking bracket."""
        low, high = low.copy(), high.copy()
        sign = np.where(self._along(origins_m, directions, low) > 0.0, -1.0, 1.0)
        lengths = 0.5 * (low + high)
        active = np.arange(len(lengths))
        for _ in range(_NEWTON_STEPS):
            if len(active) == 0:
                break
            o, d, at = origins_m[active], directions[active], lengths[active]
            values, gradients = self.level(o + at[:, None] * d)
            rising = sign[active] * values > 0.0
            high[active] = np.where(rising, at, high[active])
            low[active] = np.where(rising, low[active], at)
            slopes = np.einsum("nj,nj->n", gradients, d)
            after = at - np.divide(values, slopes, out=np.zeros_like(at), where=slopes != 0.0)
            outside = ~((after >= low[active]) & (after <= high[active])) | (slopes == 0.0)
            after = np.where(outside, 0.5 * (low[active] + high[active]), after)
            lengths[active] = after
            active = active[np.abs(after - at) > 4e-16 * np.abs(after)]
        return lengths


def _series(coefficients: tuple[float, ...], radii_m: Floats) -> tuple[Floats, Floats, Floats]:
    """Power series from r⁰ on, and its first two derivatives."""
    orders = (coefficients, polyder(coefficients), polyder(coefficients, 2))
    heights, slopes, curvatures = (
        np.asarray(polyval(radii_m, order), dtype=np.float64) for order in orders
    )
    return heights, slopes, curvatures


def _over_radius(radii: Floats, profile: Derivatives) -> Floats:
    """f'(r)/r, whose limit on the axis is f''."""
    near = radii < _TINY_M
    return np.where(near, profile.curvatures, profile.slopes / np.where(near, 1.0, radii))


@dataclass(frozen=True)
class Polynomial(Parameters, Profile, name="shape"):
    """A profile z = Σ aᵢ rⁱ, in metres."""

    shape_name = "polynomial"
    coefficients: Annotated[tuple[Signed, ...], Field(min_length=1, max_length=32)]
    """a₁, a₂, … of r, r², …; the vertex is at z = 0."""

    def derivatives(self, radii_m: Floats) -> Derivatives:
        """The polynomial and its derivatives."""
        return Derivatives(*_series((0.0, *self.coefficients), radii_m))

    def heights_m(self, radii_m: Floats) -> Floats:
        """The polynomial."""
        return np.asarray(polyval(radii_m, (0.0, *self.coefficients)))


@dataclass(frozen=True)
class Asphere(Parameters, Profile, name="shape"):
    """An even asphere: a conic and Σ αᵢ r²ⁱ from r⁴ on, in metres."""

    shape_name = "asphere"
    radius_m: Signed
    """Radius of curvature R at the vertex; more than 0: bulges towards the camera."""
    conic: Annotated[Number, Field(ge=-1e6, le=1e6)] = 0.0
    """Conic constant κ."""
    coefficients: Annotated[tuple[Signed, ...], Field(max_length=16)] = ()
    """α₂, α₃, … of r⁴, r⁶, …"""

    def _check(self) -> None:
        super()._check()
        if abs(self.radius_m) < 1e-9:
            raise self._error("radius_m", "a number of metres other than 0")

    @property
    def domain_m(self) -> float:
        """Radius of the conic's equator."""
        return float(np.sqrt(self.radius_m**2 / (1.0 + self.conic))) if self.conic > -1 else np.inf

    def derivatives(self, radii_m: Floats) -> Derivatives:
        """The conic's, by the root w of 1 − (1 + κ) r²/R², and the polynomial's."""
        curvature = 1.0 / self.radius_m
        inside = 1.0 - (1.0 + self.conic) * (curvature * radii_m) ** 2
        root = np.sqrt(np.maximum(inside, 1e-12))
        even = (0.0, *(one for a in self.coefficients for one in (0.0, a)))
        heights, slopes, curvatures = _series((0.0, 0.0, *even), radii_m)
        return Derivatives(
            curvature * radii_m**2 / (1.0 + root) + heights,
            curvature * radii_m / root + slopes,
            curvature / root**3 + curvatures,
        )


class TabulatedProfile(Profile):
    """A profile through points, by a cubic spline: its curvature is continuous.

    Args:
        radii_m: (n,) ascending, from 0.
        heights_m: (n,).
        pointed: the tip may be a cone's; else the profile is level on its axis.
    """

    shape_name = "table"

    def __init__(self, radii_m: Floats, heights_m: Floats, pointed: bool = False):
        self.radii_m, self.table_heights_m = radii_m, heights_m
        begin: Literal["not-a-knot", "clamped"] = "not-a-knot" if pointed else "clamped"
        self._spline = scipy.interpolate.CubicSpline(
            radii_m, heights_m, bc_type=(begin, "not-a-knot")
        )
        self._slope, self._curvature = self._spline.derivative(), self._spline.derivative(2)

    @property
    def domain_m(self) -> float:
        """Largest radius of the table."""
        return float(self.radii_m[-1])

    def derivatives(self, radii_m: Floats) -> Derivatives:
        """The spline and its derivatives."""
        return Derivatives(self._spline(radii_m), self._slope(radii_m), self._curvature(radii_m))

    def heights_m(self, radii_m: Floats) -> Floats:
        """The spline."""
        found: NDArray[np.float64] = self._spline(radii_m)
        return found
