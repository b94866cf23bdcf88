"""Polynomials of lenses and their inverses: radial lenses, distortion of the normalized plane."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Sequence
from functools import cached_property, lru_cache, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras.parametric_camera import PlanePoints, RadialCamera, unit_vectors
from omnisim.core.arrays import Floats

Function = Callable[[Floats], Floats]
Coefficients = Sequence[float] | NDArray[np.floating[Any]]

MAX_RADIUS_PX = 1e12  # far beyond any image
_EPS = float(np.finfo(float).eps)
MAX_STEPS = 100  # bisection alone needs about sixty


def solve_increasing(
    function: Function, slope: Function, values: Floats, low: float, high: float
) -> Floats:
    """Arguments (...,) in [low, high] at which the increasing `function` has `values` (...,).

    Unreachable values give the nearest end. The search starts at the values themselves: in units of
    the normalized plane, they are close to the arguments. A slope of 0 at an end, where a lens
    folds, only slows the search down. Steps across more than half of the bracket are replaced by
    bisections: two points of a stretched lens could otherwise lead to each other forever.
    """
    arguments = np.clip(values, low, high).ravel()
    tolerance = 4.0 * _EPS * max(abs(low), abs(high))
    active = np.arange(arguments.size)  # each search converges on its own
    target, argument = values.ravel(), arguments.copy()
    lower, upper = np.full(arguments.shape, low), np.full(arguments.shape, high)
    for _ in range(MAX_STEPS):
        error = function(argument) - target
        lower = np.where(error <= 0.0, argument, lower)
        upper = np.where(error >= 0.0, argument, upper)
        rise = slope(argument)
        newton = argument - error / np.where(rise > 1e-12, rise, 1.0)
        inside = (rise > 1e-12) & (newton >= lower) & (newton <= upper)
        inside &= np.abs(newton - argument) <= 0.5 * (upper - lower)
        following = np.where(inside, newton, 0.5 * (lower + upper))
        arguments[active] = following
        moves = np.abs(following - argument) > tolerance
        if not moves.any():
            break
        active, target, argument = active[moves], target[moves], following[moves]
        lower, upper = lower[moves], upper[moves]
    return arguments.reshape(values.shape)


def solve_polynomial(coefficients: Coefficients, values: Floats, low: float, high: float) -> Floats:
    """Arguments (...,) as of `solve_increasing`, for a polynomial with its constant term first."""
    slopes = _derivative(coefficients)
    return solve_increasing(
        partial(polyval, coefficients), partial(polyval, slopes), values, low, high
    )


def polyval(coefficients: Coefficients, arguments: Floats) -> Floats:
    """Values (...,) of a polynomial, constant term first, at arguments (...,)."""
    *others, last = (float(term) for term in coefficients)
    values = np.full(np.shape(arguments), last)
    for term in reversed(others):  # NumPy's own checks its arguments, which takes longer
        values *= arguments
        values += term
    return values


def _derivative(coefficients: Coefficients) -> list[float]:
    return [order * float(term) for order, term in enumerate(coefficients)][1:] or [0.0]


def first_root(coefficients: Coefficients, highest: float = math.inf) -> float:
    """Smallest positive real root of a polynomial, constant term first; `highest` if none is below.

    If rounding splits a double root into a complex pair, the real part of the pair counts. Leading
    terms below rounding error on the whole range up to `highest` are dropped, because they would
    spoil the accuracy of the other roots.
    """
    return _first_root(tuple(float(term) for term in coefficients), highest)


@lru_cache(maxsize=1024)  # a fit moves one parameter of a lens at a time, seldom one of its terms
def _first_root(coefficients: tuple[float, ...], highest: float) -> float:
    """`first_root` of plain numbers."""
    terms = np.array(coefficients)
    if math.isfinite(highest):
        sizes = np.abs(terms) * highest ** np.arange(len(terms), dtype=np.float64)
        while len(terms) > 1 and sizes[len(terms) - 1] < _EPS * sizes[: len(terms) - 1].max():
            terms = terms[:-1]
    roots = np.roots(np.trim_zeros(terms, "b")[::-1])
    real = roots.real[np.abs(roots.imag) <= 1e-9 * np.abs(roots)]
    return float(min([*real[real > 0.0], highest]))


# Inverse of a lens distortion on the normalized plane, by Newton's method.


Map = Callable[[Floats], Floats]
Step = Callable[[Floats, Floats], Floats]
_MAX_STEPS = 60


def undistort(
    distort: Map, newton_step: Step, start: Floats, distorted: Floats, limit: float
) -> Floats:
    """Points (..., 2), within a radius, that a distortion maps to `distorted` (..., 2).

    `newton_step` gives the inverse Jacobian at points (n, 2) times their errors (n, 2). Each guess
    of `start` (..., 2) is iterated until it converges, on the disc of radius `limit`.
    """  # fmt: skip
    plane, distorted = start.reshape(-1, 2), distorted.reshape(-1, 2)
    solved, active = plane.copy(), np.arange(len(plane))
    for _ in range(_MAX_STEPS):
        following = plane - newton_step(plane, distort(plane) - distorted)
        length = np.hypot(following[:, 0], following[:, 1])
        following *= (limit / np.maximum(length, limit))[:, None]
        solved[active] = following
        moves = np.abs(following - plane).max(axis=-1) > 1e-15 * limit
        if not moves.any():
            break
        active, plane, distorted = active[moves], following[moves], distorted[moves]
    return solved.reshape(start.shape)


# Radial and tangential distortion of the normalized plane, k1, k2, p1, p2, k3, and its inverse.
#
#     a = 1 + k1 r² + k2 r⁴ + k3 r⁶
#     x' = a x + 2 p1 x y + p2 (r² + 2 x²)
#     y' = a y + p1 (r² + 2 y²) + 2 p2 x y
#
# The map is the gradient of r²/2 + k1 r⁴/4 + k2 r⁶/6 + k3 r⁸/8 + (p2 x + p1 y) r². Its Jacobian
# is therefore symmetric, and on a disc where it is positive definite the map is one to one. The
# radial part has the eigenvalues a(r) and b(r) = 1 + 3 k1 r² + 5 k2 r⁴ + 7 k3 r⁶. The tangential
# part has no eigenvalue below −6 |p| r with |p| = √(p1² + p2²). The domain is the disc up to the
# first r with min(a, b) = 6 |p| r; without tangential distortion this r is exactly the fold.
#
# Source: Brown, "Close-range camera calibration", 1971; OpenCV's module calib3d.


ROUNDING = 1e-14  # tolerance between a distorted point and the distortion of its inverse


class RadialTangential(NamedTuple):
    """Coefficients, in OpenCV's order."""

    k1: float
    k2: float
    p1: float
    p2: float
    k3: float = 0.0

    def radius_limit(self, highest: float) -> float:
        """Radius of the disc that is the domain, at most `highest`."""
        slant = -6.0 * math.hypot(self.p1, self.p2)
        across = first_root(np.array([1.0, slant, self.k1, 0.0, self.k2, 0.0, self.k3]), highest)
        slopes = [1.0, slant, 3.0 * self.k1, 0.0, 5.0 * self.k2, 0.0, 7.0 * self.k3]
        along = first_root(np.array(slopes), highest)
        return min(across, along)

    def distort(self, plane: Floats) -> Floats:
        """Distorted points (..., 2) of points (..., 2)."""
        x, y = plane[..., :1], plane[..., 1:]
        squared = x * x + y * y
        tangential = np.array([self.p2, self.p1])
        growth = 1.0 + squared * (self.k1 + squared * (self.k2 + squared * self.k3))
        slant = self.p2 * x + self.p1 * y
        return plane * (growth + 2.0 * slant) + squared * tangential

    def undistort(self, distorted: Floats, limit: float) -> PlanePoints:
        """Points (..., 2) within `limit` that `distort` maps to `distorted` (..., 2).

        Valid where such a point exists; elsewhere, the result is another point within `limit`.
        """
        radius = np.hypot(distorted[..., 0], distorted[..., 1])
        radial = np.array([0.0, 1.0, 0.0, self.k1, 0.0, self.k2, 0.0, self.k3])
        start = solve_polynomial(radial, radius, 0.0, limit)
        plane = unit_vectors(distorted, radius) * start[..., None]
        if self.p1 or self.p2:
            plane = undistort(self.distort, self._newton_step, plane, distorted, limit)
        miss = np.abs(self.distort(plane) - distorted).max(axis=-1)
        return PlanePoints(plane, miss <= ROUNDING * np.maximum(1.0, radius))

    def _newton_step(self, plane: Floats, error: Floats) -> Floats:
        """Inverse Jacobian times an error (..., 2)."""
        # with very large coefficients, far points are not finite: no pixel sees those
        with np.errstate(over="ignore", invalid="ignore"):
            x, y = plane[..., 0], plane[..., 1]
            squared = x * x + y * y
            growth = 1.0 + squared * (self.k1 + squared * (self.k2 + squared * self.k3))
            bend = 2.0 * self.k1 + squared * (4.0 * self.k2 + 6.0 * self.k3 * squared)
            xx = growth + bend * x * x + 2.0 * self.p1 * y + 6.0 * self.p2 * x
            yy = growth + bend * y * y + 6.0 * self.p1 * y + 2.0 * self.p2 * x
            xy = bend * x * y + 2.0 * self.p1 * x + 2.0 * self.p2 * y
            determinant = np.maximum(xx * yy - xy * xy, 1e-12)
            ex, ey = error[..., 0], error[..., 1]
            step = np.stack((yy * ex - xy * ey, xx * ey - xy * ex), axis=-1)
            return np.asarray(step / determinant[..., None])


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
        return first_root(_derivative(self.theta_polynomial), math.tau)

    @property
    def theta_edge_rad(self) -> float:
        """Angle from the axis where the domain ends: θ_max, or the fold before it."""
        return min(self.theta_max_rad, self.fold_rad)

    def _radius_from_theta(self, theta: Floats) -> Floats:
        return polyval(self.theta_polynomial, theta)

    def _theta_from_radius(self, radius: Floats) -> Floats:
        return solve_polynomial(self.theta_polynomial, radius, 0.0, self.theta_edge_rad)
