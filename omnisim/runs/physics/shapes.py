"""Shapes of convex pieces: balls, boxes, or else hulls."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy  # its submodules load when first used
from numpy.typing import NDArray

from omnisim.runs.physics.hulls import convex_hull

ROUND = 0.02  # maximum difference of a ball's vertex radii, relative
FULL_BALL = 0.9 * 4.0 / 3.0 * math.pi  # minimum hull volume of a ball of radius 1
RIGHT_ANGLE = 1e-3  # maximum cosine between axes at a right angle
FULL = 0.999  # minimum share of its bounding box that a box's hull fills


@dataclass(frozen=True, eq=False)
class Shape:
    """Shape of a piece in the frame of its vertices.

    Attributes:
        kind: "ball", "box" or "hull".
        center_m: (3,) center.
        axes: (3, 3) axes of a box, in columns; identity for other kinds.
        half_m: (3,) half sides of a box, or radius of a ball.
        vertices_m: (n, 3) corners of the hull, relative to the center.
    """

    kind: Literal["ball", "box", "hull"]
    center_m: NDArray[np.float64]
    axes: NDArray[np.float64]
    half_m: NDArray[np.float64]
    vertices_m: NDArray[np.float64]

    @classmethod
    def of(cls, vertices_m: NDArray[np.float64]) -> Shape | None:
        """Shape of the hull of vertices (n, 3); None: the vertices are coplanar."""
        hull = convex_hull(vertices_m)
        if hull is None:
            return None
        corners = vertices_m[hull.vertices]
        return _ball(corners, hull) or _box(corners, hull) or _hull(corners)


def _ball(corners_m: NDArray[np.float64], hull: scipy.spatial.ConvexHull) -> Shape | None:
    center = 0.5 * (corners_m.min(axis=0) + corners_m.max(axis=0))
    radii = np.linalg.norm(corners_m - center, axis=1)
    radius = float(radii.max())
    if radii.min() < (1.0 - ROUND) * radius or hull.volume < FULL_BALL * radius**3:
        return None
    return Shape("ball", center, np.eye(3), np.full(3, radius), corners_m - center)


def _box(corners_m: NDArray[np.float64], hull: scipy.spatial.ConvexHull) -> Shape | None:
    axes: list[NDArray[np.float64]] = []
    for normal in hull.equations[:, :3]:
        if all(abs(float(axis @ normal)) < RIGHT_ANGLE for axis in axes):
            axes.append(normal)
    if len(axes) < 3:
        return None
    rotation = np.stack((axes[0], axes[1], np.cross(axes[0], axes[1])), axis=1)
    along = corners_m @ rotation
    low, high = along.min(axis=0), along.max(axis=0)
    if hull.volume < FULL * float(np.prod(high - low)):
        return None
    center = rotation @ (0.5 * (low + high))
    return Shape("box", center, rotation, 0.5 * (high - low), corners_m - center)


def _hull(corners_m: NDArray[np.float64]) -> Shape:
    center = corners_m.mean(axis=0)
    return Shape("hull", center, np.eye(3), np.zeros(3), corners_m - center)
