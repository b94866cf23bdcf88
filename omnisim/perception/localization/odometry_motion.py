"""Motion model of a planar pose from wheel readings, and its Jacobians."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

# Below, an arc's chord equals its length to rounding: the next term of the series is 1e-18.
_STRAIGHT_RAD = 1e-8


def move(
    pose: NDArray[np.float64], distance_m: float, turn_rad: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Follow an arc from a pose.

    Args:
        pose: (3,) x and y in meters and yaw in radians, world.
        distance_m: length of the arc, negative backward; the paper's v times the step's duration.
        turn_rad: turn along the arc; the paper's δφ.

    Returns:
        The new pose (3,), yaw not wrapped; its Jacobians (3, 3) by the pose and (3, 2) by distance
        and turn.

    Source: the arcs of `omnisim.core.trajectories.odometry`, which dead reckoning follows.
    """
    x, y, yaw = pose.tolist()
    half = 0.5 * turn_rad
    if abs(half) < _STRAIGHT_RAD:
        chord, slope = 1.0, -half / 3.0
    else:
        chord = math.sin(half) / half
        slope = (math.cos(half) - chord) / half  # derivative of the chord by half the turn
    along = yaw + half
    cosine, sine = math.cos(along), math.sin(along)
    dx, dy = distance_m * chord * cosine, distance_m * chord * sine
    by_turn = 0.5 * distance_m
    by_pose = np.array([[1.0, 0.0, -dy], [0.0, 1.0, dx], [0.0, 0.0, 1.0]])
    by_control = np.array(
        [
            [chord * cosine, by_turn * (slope * cosine - chord * sine)],
            [chord * sine, by_turn * (slope * sine + chord * cosine)],
            [0.0, 1.0],
        ]
    )
    return np.array([x + dx, y + dy, yaw + turn_rad]), by_pose, by_control
