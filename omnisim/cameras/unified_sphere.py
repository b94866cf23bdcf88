"""Sphere of the unified model in its α form, shared by EUCM and the double sphere.

A point p on the unit sphere is projected to (x, y)/(α + (1 − α) z). With ξ = α/(1 − α), this is
Geyer and Mei's projection from a point ξ above the sphere's center, in an image 1 + ξ times as
large.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras.camera import Rays
from omnisim.cameras.plane_camera import EDGE_RAD, PlanePoints

MAX_RADIUS = 1e6  # on the normalized plane, if nothing else bounds it: nearly at the limit angle


def cosine_limit(alpha: float) -> float:
    """Lower limit of z on the unit sphere: −w, with w = α/(1 − α) for α ≤ 0.5, else (1 − α)/α."""
    return -alpha / (1.0 - alpha) if alpha <= 0.5 else -(1.0 - alpha) / alpha


def plane_limit(alpha: float) -> float:
    """Largest radius on the normalized plane: 1/√(2α − 1), where the image folds, if α > 0.5."""
    return min(MAX_RADIUS, 1.0 / math.sqrt(2.0 * alpha - 1.0)) if alpha > 0.5 else MAX_RADIUS


def lift_alpha(plane: NDArray[np.float64], alpha: float) -> Rays:
    """Unit vectors (..., 3) of points (..., 2); points beyond `plane_limit` are moved onto it."""
    radius = np.hypot(plane[..., 0], plane[..., 1])
    limit = plane_limit(alpha)
    valid = radius <= limit
    shrink = limit / np.maximum(radius, limit)
    plane = plane * shrink[..., None]
    squared = np.sum(plane * plane, axis=-1)
    root = np.sqrt(np.maximum(1.0 - (2.0 * alpha - 1.0) * squared, 0.0))
    z = (1.0 - alpha * alpha * squared) / (alpha * root + 1.0 - alpha)
    directions = np.concatenate((plane, z[..., None]), axis=-1)
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    return Rays(directions, valid)


def project_alpha(
    directions: NDArray[np.float64],
    z: NDArray[np.float64],
    distance: NDArray[np.float64],
    alpha: float,
    length: NDArray[np.float64],
) -> PlanePoints:
    """Project directions (..., 3) to the normalized plane: (x, y)/(α d + (1 − α) z).

    `z` and `distance` d (...,) are those of the model's last sphere. `length` (...,) is the length
    of the directions, used as the scale of rounding errors.
    """
    valid = z > (cosine_limit(alpha) - EDGE_RAD) * distance
    scale = alpha * distance + (1.0 - alpha) * z
    valid &= scale > 1e-12 * length
    scale = np.where(valid, scale, 1.0)
    return PlanePoints(directions[..., :2] / scale[..., None], valid)
