"""Consistency of a filter: NEES and NIS against their χ² bounds.

Source: Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001,
section 5.4.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import chi2

from omnisim.core.poses import wrap_angles


class Interval(NamedTuple):
    """Probability interval of a mean."""

    low: float
    high: float


def mean_interval(degrees: int, count: int, share: float = 0.95) -> Interval:
    """Two-sided interval that contains the mean of χ² values with probability `share`.

    The mean is that of `count` independent values, each with `degrees` degrees of freedom.
    """
    tail = 0.5 * (1.0 - share)
    low, high = (float(chi2.ppf(share, degrees * count)) for share in (tail, 1.0 - tail))
    return Interval(low / count, high / count)


def pose_errors(estimated: ArrayLike, true: ArrayLike) -> NDArray[np.float64]:
    """Estimated minus true poses (..., 3): x and y in m, yaw in rad within ±π."""
    errors = np.asarray(estimated, dtype=np.float64) - np.asarray(true, dtype=np.float64)
    errors[..., 2] = wrap_angles(errors[..., 2])
    return errors


def nees(errors: NDArray[np.float64], covariances: NDArray[np.float64]) -> NDArray[np.float64]:
    """Normalized estimation errors squared (n,) of errors (n, 3) by covariances (n, 3, 3).

    NaN where a covariance is singular, as that of an exactly known start.
    """
    errors_squared = np.full(len(errors), np.nan)
    for k, (error, covariance) in enumerate(zip(errors, covariances, strict=True)):
        values, axes = np.linalg.eigh(covariance)
        if values[0] > 1e-14 * max(values[-1], 1e-300):
            errors_squared[k] = float(np.sum(np.square(axes.T @ error) / values))
    return errors_squared
