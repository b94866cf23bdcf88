"""Measurement model of landmarks: range and bearing, the paper's m = (r, γ).

A slim landmark, such as a beacon, is a point: its axis. A wide landmark, such as a goal, has
corners: its bearing is the middle between the two corners that are outermost as seen by the camera,
and its range is that of the nearest corner. An image shows both range and bearing, and neither
requires the landmark's orientation.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from omnisim.core.errors import LocalizationError
from omnisim.scene.model import Landmark

# Minimum distance for a bearing: the camera would be inside the landmark.
NEAREST_M = 1e-6


@dataclass(frozen=True)
class Observation:
    """Measurement of one landmark in one image.

    Attributes:
        candidates: names of the possible landmarks; one name if the colors are unambiguous.
        range_m: distance along the ground from below the effective viewpoint.
        bearing_rad: counter-clockwise from the vehicle's front.
        range_sigma_m, bearing_sigma_rad: standard deviations.
    """

    candidates: tuple[str, ...]
    range_m: float
    bearing_rad: float
    range_sigma_m: float
    bearing_sigma_rad: float


Corners = tuple[tuple[float, float], ...]  # x and y of a landmark's corners in the world, meters


class LandmarkMap:
    """Map of landmarks.

    Args:
        corners_m: by landmark's name, (n, 2) corners in the world; a single corner for a point.

    Attributes:
        corners_m: corners of each landmark, by name.

    Raises:
        LocalizationError: no landmark, or corners that are not finite.
    """

    def __init__(self, corners_m: Mapping[str, ArrayLike]):
        if not corners_m:
            raise LocalizationError("landmarks: expected at least one to localize by")
        self.corners_m: dict[str, Corners] = {}
        for name, corners in corners_m.items():
            given = np.atleast_2d(np.asarray(corners, dtype=np.float64))
            if given.ndim != 2 or given.shape[1] != 2 or not np.all(np.isfinite(given)):
                raise LocalizationError(f"landmark {name!r}: expected finite corners (x, y)")
            self.corners_m[name] = tuple((x, y) for x, y in given.tolist())

    @classmethod
    def of_scene(
        cls, landmarks: Iterable[Landmark], offsets_m: Mapping[str, ArrayLike] | None = None
    ) -> LandmarkMap:
        """Build the map of a scene's landmarks.

        Args:
            landmarks: landmarks with positions and footprints.
            offsets_m: by name, errors (2,) of the map, which are added to the positions.
        """
        offsets, corners = offsets_m or {}, {}
        for landmark in landmarks:
            middle = np.array(landmark.position_m[:2]) + np.asarray(
                offsets.get(landmark.name, 0.0), dtype=np.float64
            )
            half = 0.5 * np.array(landmark.footprint_m)
            if landmark.is_slim:
                corners[landmark.name] = middle[None]
            else:
                signs = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
                corners[landmark.name] = middle + signs * half
        return cls(corners)

    def corners(self, name: str) -> Corners:
        """Corners of a landmark.

        Raises:
            LocalizationError: the map does not have it.
        """
        try:
            return self.corners_m[name]
        except KeyError:
            raise LocalizationError(
                f"landmark {name!r}: not on the map, which has {', '.join(self.corners_m)}"
            ) from None


def predict_measurement(
    pose: tuple[float, float, float], camera_m: tuple[float, float], corners_m: Corners
) -> tuple[float, ...]:
    """Predict range and bearing of a landmark from a pose, with their Jacobian.

    Computes in plain floats: for one landmark at a time NumPy takes ten times as long.

    Args:
        pose: pose of the base: x and y in meters, yaw in radians; world.
        camera_m: x and y of the effective viewpoint in the base frame.
        corners_m: corners of the landmark.

    Returns:
        Range in meters and its derivatives by x, y and yaw; bearing in radians, not wrapped, and
        its derivatives.
    """
    x, y, yaw = pose
    cosine, sine = math.cos(yaw), math.sin(yaw)
    arm_x = cosine * camera_m[0] - sine * camera_m[1]
    arm_y = sine * camera_m[0] + cosine * camera_m[1]
    offsets = [(corner_x - x - arm_x, corner_y - y - arm_y) for corner_x, corner_y in corners_m]
    near_x, near_y = min(offsets, key=_squared)
    distance = max(math.hypot(near_x, near_y), NEAREST_M)
    unit_x, unit_y = near_x / distance, near_y / distance
    if len(offsets) == 1:
        bearing, right, left = math.atan2(near_y, near_x), offsets[0], offsets[0]
    else:
        # directions relative to their sum, so that none wraps around
        sum_x = sum(offset[0] for offset in offsets)
        sum_y = sum(offset[1] for offset in offsets)
        turns = [
            (math.atan2(sum_x * dy - sum_y * dx, sum_x * dx + sum_y * dy), (dx, dy))
            for dx, dy in offsets
        ]
        (low, right), (high, left) = min(turns), max(turns)
        bearing = math.atan2(sum_y, sum_x) + 0.5 * (low + high)
    by_x = by_y = 0.0
    for dx, dy in (right, left):
        squared = max(dx * dx + dy * dy, NEAREST_M**2)
        by_x += 0.5 * dy / squared
        by_y -= 0.5 * dx / squared
    return (
        distance, -unit_x, -unit_y, unit_x * arm_y - unit_y * arm_x,
        bearing - yaw, by_x, by_y, by_y * arm_x - by_x * arm_y - 1.0,
    )  # fmt: skip


def _squared(offset: tuple[float, float]) -> float:
    return offset[0] * offset[0] + offset[1] * offset[1]
