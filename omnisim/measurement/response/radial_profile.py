"""Light by image radius, fitted to blocks of a flat field, as the polynomial of a sensor file.

A polynomial of few powers does not follow the cos⁴ law over a wide field: least squares leave its
largest errors in the corners, where there are few blocks. A profile (a + b r² + c r⁴ + d r⁶) /
(1 + k r²)² follows it with fewer unknowns; the polynomial is then interpolated from the profile.

Source: Trefethen, "Approximation Theory and Approximation Practice" (2013), for Chebyshev points.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from omnisim.rendering.camera.degradations.vignetting import MAX_TERMS

Floats = NDArray[np.float64]
MIN_TERMS = 3
_RATES = np.geomspace(0.05, 4.0, 24)  # squared tangents at r = 1: fields up to 127° across
_RING = 31  # blocks of about the same radius
_MIN_SPREAD = 2.5e-4  # of the light: what is off by less than four of it is no outlier
_MIN_ERROR = 5e-5  # of the light: smaller errors are as good
_MAX_ERROR_RATIO = 1.005  # times the smallest error of all profiles
_ROUNDS, _MIN_ROUNDS = 6, 2  # profile and gradient converge in two
_POINTS = 200


class RadialProfile(NamedTuple):
    """Light (a + b r² + c r⁴ + …) / (1 + k r²)² of blocks, and its gradient over the image.

    Attributes:
        solution: (terms,) coefficients a, b, c and so on.
        rate: k, the squared tangent of the field angle at r = 1; 0: a polynomial.
        gradient: (2,) relative change of the light over the image's width and height.
        is_kept: (blocks,) False: outliers.
        residuals: (blocks,) measured minus fitted light.
    """

    solution: Floats
    rate: float
    gradient: Floats
    is_kept: NDArray[np.bool_]
    residuals: Floats

    @property
    def rms(self) -> float:
        """Root mean square of the residuals of the kept blocks."""
        return float(np.sqrt(np.mean(np.square(self.residuals[self.is_kept]))))

    def terms(self, squared: Floats) -> Floats:
        """Functions (n, terms) of squared radii (n,); their sum by `solution` is the profile."""
        return _terms(squared, len(self.solution), self.rate)

    def polynomial_from_solution(self, largest_squared: float) -> Floats:
        """Matrix (powers, terms) from `solution` to coefficients of r², r⁴ and so on.

        The polynomial is that of a field up to a squared radius, in units of the light at r = 0.
        """
        count = len(self.solution)
        if self.rate == 0.0:
            powers_alone: Floats = np.eye(count)[1:] / self.solution[0]
            return powers_alone
        angles = np.pi * (np.arange(_POINTS) + 0.5) / _POINTS
        squared = 0.5 * largest_squared * (1.0 - np.cos(angles))
        powers = _terms(squared, MAX_TERMS + 1, 0.0)
        relative = self.terms(squared) - _terms(np.zeros(1), count, self.rate)
        matrix = np.linalg.lstsq(powers[:, 1:], relative, rcond=None)[0]
        scaled: Floats = matrix / self.solution[0]
        return scaled


def fit_profile(light: Floats, squared: Floats, offsets: Floats, brightest: float) -> RadialProfile:
    """Fit the profile with the fewest unknowns among those as good as the best one.

    Args:
        light: (blocks,) light.
        squared: (blocks,) squared radius, in units of half the shorter side.
        offsets: (blocks, 2) x and y from the center, as shares of the image's width and height.
        brightest: light of the brightest blocks.
    """
    polynomials = [
        _fit(light, squared, offsets, count + 1, 0.0, brightest)
        for count in range(MIN_TERMS, MAX_TERMS + 1)
    ]
    judged = polynomials[-1].is_kept
    even = light / (1.0 + offsets @ polynomials[-1].gradient)
    rate = min(_RATES, key=lambda one: _misfit(even[judged], squared[judged], float(one)))
    wide = _fit(light, squared, offsets, MIN_TERMS + 1, float(rate), brightest)
    profiles = [*polynomials[:2], wide, *polynomials[2:]]  # by their number of unknowns
    errors = [float(np.sqrt(np.mean(np.square(one.residuals[judged])))) for one in profiles]
    limit = max(_MAX_ERROR_RATIO * min(errors), _MIN_ERROR * brightest)
    return next(one for one, rms in zip(profiles, errors, strict=True) if rms <= limit)


def _misfit(light: Floats, squared: Floats, rate: float) -> float:
    """Sum of squared errors of a profile fitted to light (blocks,)."""
    terms = _terms(squared, MIN_TERMS + 1, rate)
    side = terms.T @ light
    return float(light @ light - side @ np.linalg.solve(terms.T @ terms, side))


def _terms(squared: Floats, count: int, rate: float) -> Floats:
    """Functions (n, count) of squared radii (n,): powers from r⁰, divided by (1 + k r²)²."""
    terms: Floats = np.vander(squared, count, increasing=True)
    terms /= np.square(1.0 + rate * squared)[:, None]
    return terms


def _fit(
    light: Floats, squared: Floats, offsets: Floats, count: int, rate: float, brightest: float
) -> RadialProfile:
    """Fit profile × (1 + g · (x, y)): profile and g in turn, without outliers.

    Args:
        light: (blocks,) light.
        squared: (blocks,) squared radius, in units of half the shorter side.
        offsets: (blocks, 2) x and y from the center, as shares of the image's width and height.
        count: number of the profile's terms.
        rate: see `RadialProfile`.
        brightest: light of the brightest blocks.
    """
    terms = _terms(squared, count, rate)
    is_kept: NDArray[np.bool_] = np.ones(len(light), dtype=bool)
    gradient: Floats = np.zeros(2)
    solution: Floats = np.zeros(count)
    for number in range(_ROUNDS):
        design = terms * (1.0 + offsets @ gradient)[:, None]
        solution[:] = np.linalg.lstsq(design[is_kept], light[is_kept], rcond=None)[0]
        even = terms @ solution
        tilt = even[:, None] * offsets
        gradient[:] = np.linalg.lstsq(tilt[is_kept], (light - even)[is_kept], rcond=None)[0]
        residuals = light - even * (1.0 + offsets @ gradient)
        before = is_kept
        deviations = np.abs(residuals - _ring_medians(residuals, squared))
        spread = 1.4826 * float(np.median(deviations[is_kept]))
        is_kept = deviations <= 4.0 * max(spread, _MIN_SPREAD * brightest)
        if number >= _MIN_ROUNDS and np.array_equal(before, is_kept):
            break
    return RadialProfile(solution, rate, gradient, is_kept, residuals)


def _ring_medians(residuals: Floats, squared: Floats) -> Floats:
    """Median residual (blocks,) of the blocks of about the same radius.

    A misfit of the profile is the same all around, and no outlier. Otherwise the corners of wide
    fields would be left out, where the polynomial then rises at will.
    """
    order = np.argsort(squared, kind="stable")
    medians = np.empty_like(residuals)
    medians[order] = median_filter(residuals[order], size=_RING, mode="nearest")
    return medians
