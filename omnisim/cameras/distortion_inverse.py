"""Inverse of a lens distortion of the normalized plane, by Newton's method."""

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
    """Points (..., 2) within a radius that a distortion takes to `distorted` (..., 2).

    Args:
        distort: distorted points (n, 2) of points (n, 2).
        newton_step: the Jacobian's inverse at points (n, 2) times errors (n, 2).
        start: (..., 2) first guesses; each is improved until it converges.
        distorted: points.
        limit: radius of the disc that all steps stay in.
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
