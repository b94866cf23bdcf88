"""Points of the unit square and directions of a hemisphere, evenly spread with random shifts.

Source: Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018; the shifts are
those of Cranley and Patterson, "Randomization of number theoretic methods", 1976.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
_STEPS = np.array((0.7548776662466927, 0.5698402909980532))


def generator(seed: int, stage: int, tile: int) -> np.random.Generator:
    """Random number generator of one tile of one stage, independent of the others."""
    return np.random.Generator(np.random.Philox(key=seed, counter=(0, 0, stage, tile)))


def spread_points(count: int) -> Floats:
    """Points (n, 2) of the R2 sequence in the unit square."""
    return ((0.5 + np.arange(1, count + 1)[:, None] * _STEPS) % 1.0).astype(np.float32)


def turned(points: Floats, shifts: Floats) -> Floats:
    """Points (n, k, 2) in the unit square: points (k, 2) with wrap-around shifts (n, 2)."""
    places = shifts[:, None] + points
    places -= np.floor(places)
    return places


def cosine_directions(points: Floats, normals: Floats) -> tuple[Floats, Floats]:
    """Directions (n, k, 3) about unit normals (n, 3) from points (n, k, 2); cosines (n, k).

    Their probability density is the cosine over pi.
    Source of the axes: Duff et al., "Building an orthonormal basis, revisited", 2017.
    """
    x, y, z = (normals[:, axis, None] for axis in range(3))
    sign = np.where(z >= 0.0, np.float32(1.0), np.float32(-1.0))
    a = -1.0 / (sign + z)
    b = x * y * a
    radius = np.sqrt(points[..., 0])
    angle = np.float32(2.0 * np.pi) * points[..., 1]
    u, v = radius * np.cos(angle), radius * np.sin(angle)
    cosines = np.sqrt(np.maximum(1.0 - points[..., 0], np.float32(1e-6)))
    directions = np.empty((*cosines.shape, 3), dtype=np.float32)
    directions[..., 0] = u * (1.0 + sign * x * x * a) + v * b + cosines * x
    directions[..., 1] = u * (sign * b) + v * (sign + y * y * a) + cosines * y
    directions[..., 2] = -u * (sign * x) - v * y + cosines * z
    return directions, cosines


def sphere_directions(points: Floats) -> Floats:
    """Unit directions (n, 3), uniform over the sphere, from points (n, 2)."""
    z = 1.0 - 2.0 * points[:, 0]
    side = np.sqrt(np.maximum(1.0 - z * z, 0.0))
    angle = np.float32(2.0 * np.pi) * points[:, 1]
    return np.stack((side * np.cos(angle), side * np.sin(angle), z), axis=1).astype(np.float32)
