"""Curves over the image radius, fitted to many edges: point spread and lateral color."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnisim.measurement.sharpness.edge_fit import Floats

MAX_SPREAD_DEGREE, MAX_COLOR_DEGREE = 4, 3
MIN_EDGES_PER_TERM = 3
MIN_SPREAD = 0.15  # of the squared cosines: less does not tell radial from tangential
_OUTLIER = 4.0  # robust standard deviations
_ROUNDS = 5

Design = Callable[[int], Floats]  # (n, terms) by the degree


@dataclass(frozen=True, eq=False)
class Curve:
    """Linear combination of basis functions.

    Attributes:
        degree: degree of the polynomial, chosen by Akaike's information criterion.
        coefficients: (terms,) coefficients of the least-squares fit.
        covariance: (terms, terms) covariance of the coefficients, with the scatter of the edges.
        used: (n,) False: an outlier.
    """

    degree: int
    coefficients: Floats
    covariance: Floats
    used: NDArray[np.bool_]

    def at(self, design: Floats) -> tuple[Floats, Floats]:
        """Values (n,) and standard deviations (n,) of the curve.

        Args:
            design: (n, terms) basis functions at n positions.
        """
        variance = np.einsum("ij,jk,ik->i", design, self.covariance, design)
        return design @ self.coefficients, np.sqrt(np.maximum(variance, 0.0))


def fit_curve(design: Design, values: Floats, sigmas: Floats, degrees: Sequence[int]) -> Curve:
    """Fit a curve to values (n,) with standard deviations `sigmas` (n,), without outliers.

    Args:
        design: function from a degree to the basis functions (n, terms).
        values: (n,) values.
        sigmas: (n,) standard deviations of the values.
        degrees: degrees to try, ascending; all but the first need three values per term.
    """
    count = len(values)
    usable = [
        degree
        for degree in degrees
        if degree == degrees[0] or MIN_EDGES_PER_TERM * design(degree).shape[1] <= count
    ]
    used = _inliers(design(usable[-1]), values, sigmas)
    curves = [_least_squares(degree, design(degree), values, sigmas, used) for degree in usable]
    return min(curves, key=lambda scored: scored[0])[1]


def _inliers(rows: Floats, values: Floats, sigmas: Floats) -> NDArray[np.bool_]:
    """Mask (n,) of the values close to the curve with the basis functions `rows` (n, terms)."""
    used = np.ones(len(values), dtype=np.bool_)
    for _ in range(_ROUNDS):
        scaled = (values - rows @ _solve(rows, values, sigmas, used)) / sigmas
        middle = float(np.median(scaled[used]))
        spread = 1.4826 * float(np.median(np.abs(scaled[used] - middle)))
        used = np.abs(scaled - middle) <= _OUTLIER * max(spread, 1.0)
    return used


def _least_squares(
    degree: int, rows: Floats, values: Floats, sigmas: Floats, used: NDArray[np.bool_]
) -> tuple[float, Curve]:
    """Akaike's information criterion and the fitted curve of one degree."""
    coefficients = _solve(rows, values, sigmas, used)
    chi2 = float((((values - rows @ coefficients) / sigmas)[used] ** 2).sum())
    terms, number = rows.shape[1], int(used.sum())
    score = number * float(np.log(max(chi2, 1e-12) / number)) + 2.0 * terms
    excess = max(1.0, chi2 / max(number - terms, 1))
    weighted = rows[used] / sigmas[used, None]
    covariance = np.asarray(excess * np.linalg.pinv(weighted.T @ weighted), dtype=np.float64)
    return score, Curve(degree, coefficients, covariance, used)


def _solve(rows: Floats, values: Floats, sigmas: Floats, used: NDArray[np.bool_]) -> Floats:
    weights = used / sigmas
    solution = np.linalg.lstsq(rows * weights[:, None], values * weights, rcond=None)[0]
    return np.asarray(solution, dtype=np.float64)


def spread_rows(radii: Floats, radial_share: Floats, degree: int, isotropic: bool) -> Floats:
    """Basis functions (n, terms) of the variance of the point spread along the edges' normals.

    The radial and the tangential variance are polynomials of the radius, equal in the center.

    Args:
        radii: (n,) relative image radii.
        radial_share: (n,) squared cosine between normal and radius.
        degree: degree of the polynomials.
        isotropic: True if both variances are equal.
    """
    columns = [np.ones_like(radii)]
    for power in range(1, degree + 1):
        if isotropic:
            columns.append(radii**power)
        else:
            columns += [radial_share * radii**power, (1.0 - radial_share) * radii**power]
    return np.stack(columns, axis=-1)


def offset_rows(radii: Floats, radial: Floats, degree: int) -> Floats:
    """Basis functions (n, degree) of the shift along edges' normals, for a radial offset.

    Args:
        radii: (n,) relative image radii.
        radial: (n,) cosine between normal and radius.
        degree: degree of the offset's polynomial, which is 0 in the center.
    """
    return np.stack([radial * radii**power for power in range(1, degree + 1)], axis=-1)
