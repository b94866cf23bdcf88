"""Time-optimal timing of given poses, within the limits of a robot."""

from __future__ import annotations

import math
from collections import deque

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import TrajectoryError
from omnisim.core.trajectories.trajectory import Trajectory, check_poses
from omnisim.robots.kinematics import Kinematics, steps_between

# Durations grow until no mean rate exceeds the limits by more than this relative tolerance.
CONVERGED = 1e-9


def time_poses(world_from_base: NDArray[np.float64], kinematics: Kinematics) -> Trajectory:
    """Assign times to poses (n, 4, 4), from rest at 0 s to rest at the last pose.

    Each step first gets the duration that its speed and turn rate require. If the mean rates of two
    neighboring steps then differ by more than the accelerations allow, the faster step is
    lengthened, until no such pair is left. A neighbor without motion counts as rest, so the robot
    has to brake before it. Between poses only means are known. The result is therefore faster than
    `motion_profile`, whose speeds are exact, by less than one step's duration per top speed.

    Raises:
        TrajectoryError: invalid poses, or two successive poses are identical.
    """
    poses = np.asarray(world_from_base, dtype=np.float64)
    if poses.ndim != 3 or poses.shape[1:] != (4, 4) or not len(poses):
        raise TrajectoryError(f"trajectory: poses {poses.shape}: expected (n, 4, 4), n ≥ 1")
    check_poses(poses)
    steps = steps_between(poses)
    amounts = np.stack((steps.distances_m, steps.turns_rad))
    amounts[np.abs(amounts) < 1e-12] = 0.0  # rounding errors do not count as motion
    still = np.all(amounts == 0.0, axis=0)
    if np.any(still):
        k = int(np.argmax(still))
        raise TrajectoryError(
            f"trajectory: poses {k} and {k + 1} are the same: how long the robot waits there "
            "is unknown without times: expected one of them"
        )
    limits = (
        (kinematics.max_speed_mps, kinematics.max_acceleration_mps2),
        (kinematics.max_turn_rate_radps, kinematics.max_turn_acceleration_radps2),
    )
    durations = np.zeros(amounts.shape[1])
    for row, (rate, acceleration) in zip(amounts, limits, strict=True):
        durations = np.maximum(durations, np.abs(row) / rate)
        durations = np.maximum(durations, _from_rest_or_to_it(row, acceleration))
    _lengthen(durations, amounts, [acceleration for _, acceleration in limits])
    return Trajectory(np.concatenate(((0.0,), np.cumsum(durations))), poses)


def _from_rest_or_to_it(amounts: NDArray[np.float64], acceleration: float) -> NDArray[np.float64]:
    """Durations (n,) of steps that start or end at rest, or both; 0 for all others."""
    moves = np.concatenate(((False,), amounts != 0.0, (False,)))
    rests = (~moves[:-2]).astype(int) + ~moves[2:]  # number of neighbors at rest: 0, 1 or 2
    return np.sqrt(2.0 * rests * np.abs(amounts) / acceleration)


def _lengthen(
    durations: NDArray[np.float64], amounts: NDArray[np.float64], accelerations: list[float]
) -> None:
    """Lengthen durations (n,) in place until neighbors' mean rates satisfy the accelerations.

    Args:
        durations: (n,) durations that already satisfy the speeds and the steps next to rest.
        amounts: (quantities, n) distances and turn angles.
        accelerations: limit per quantity.
    """
    waiting = deque(range(len(durations) - 1))
    while waiting:
        k = waiting.popleft()
        for row, acceleration in zip(amounts, accelerations, strict=True):
            if row[k] == 0.0 or row[k + 1] == 0.0:
                continue  # `_from_rest_or_to_it` covers steps next to rest
            rates = row[k : k + 2] / durations[k : k + 2]
            reach = 0.5 * acceleration * float(durations[k] + durations[k + 1])
            if abs(rates[1] - rates[0]) <= reach * (1.0 + CONVERGED):
                continue
            fast, slow = (k, k + 1) if abs(rates[0]) > abs(rates[1]) else (k + 1, k)
            # |amount| / t ∓ |rate of the slower step| = acceleration (t + its duration) / 2
            sign = 1.0 if rates[0] * rates[1] > 0.0 else -1.0
            b = 0.5 * acceleration * float(durations[slow]) + sign * abs(float(rates[slow - k]))
            root = math.sqrt(b * b + 2.0 * acceleration * abs(float(row[fast])))
            durations[fast] = max(durations[fast], (root - b) / acceleration)
            waiting.extend(near for near in (fast - 1, fast) if 0 <= near < len(durations) - 1)
