"""Inverse of a lens distortion on the normalized plane, by Newton's method."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Map = Callable[[NDArray[np.float64]], NDArray[np.float64]]
Step = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]
_MAX_STEPS = 60


def undistort(
    distort: Map,
    newton_step: Step,
    start: NDArray[np.float64],
    distorted: NDArray[np.float64],
    limit: float,
) -> NDArray[np.float64]:
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
