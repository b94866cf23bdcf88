"""Inverse of an increasing function of one variable, by bracketed Newton's method."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from typing import Any

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import NDArray

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
    slopes = polynomial.polyder(coefficients)
    return solve_increasing(
        partial(polyval, coefficients), partial(polyval, slopes), values, low, high
    )


def polyval(coefficients: Coefficients, arguments: Floats) -> Floats:
    """Values (...,) of a polynomial, constant term first, at arguments (...,)."""
    *others, last = (float(one) for one in coefficients)
    values = np.full(np.shape(arguments), last)
    for one in reversed(others):  # NumPy's own checks its arguments, which takes longer
        values *= arguments
        values += one
    return values


def first_root(coefficients: Coefficients, highest: float = math.inf) -> float:
    """Smallest positive real root of a polynomial, constant term first; `highest` if none is below.

    If rounding splits a double root into a complex pair, the real part of the pair counts. Leading
    terms below rounding error on the whole range up to `highest` are dropped, because they would
    spoil the accuracy of the other roots.
    """
    return _first_root(tuple(float(one) for one in coefficients), highest)


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

    Args:
        distort: function from points (n, 2) to distorted points (n, 2).
        newton_step: function from points (n, 2) and errors (n, 2) to inverse Jacobian times error.
        start: (..., 2) initial guesses; each is iterated until it converges.
        distorted: (..., 2) distorted points.
        limit: radius of the disc to which all steps are confined.
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
