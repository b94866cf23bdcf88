"""Path following: wheel speeds that keep a robot on its planned motion."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from omnisim.core.poses import wrap_angle, yaw_from_rotation
from omnisim.core.trajectories.body_motion import BodyMotion
from omnisim.runs.physics.rover import Rover

AHEAD_PER_S, TURN_PER_S = 4.0, 6.0  # gains on the error along the path, and on the heading error
TURN_PER_M2 = 16.0  # gain on the lateral error, per meter driven
RESERVE = 1.25  # factor on the limits, which allows the robot to catch up


class PathFollower:
    """Tracking controller that knows the robot's true pose.

    Source: Kanayama et al., "A stable tracking control method for an autonomous mobile robot", ICRA
    1990, with a correction of the heading that does not vanish at rest.

    Args:
        motion: planned motion; its x, y and yaw are tracked.
        rover: robot on wheels.
        times_s: (n,) times of the commands.
    """

    def __init__(self, motion: BodyMotion, rover: Rover, times_s: NDArray[np.float64]):
        states = motion.at(times_s)
        poses = states.world_from_base
        planar = np.column_stack((poses[:, :2, 3], yaw_from_rotation(poses)))
        turn_rates = np.einsum("ni,ni->n", poses[:, 2, :3], states.angular_rate_radps)
        self._poses, self._rates = planar, np.column_stack((states.velocity_mps[:, :2], turn_rates))
        self._rover = rover

    def distance_m(self, command: int, base: NDArray[np.float64]) -> float:
        """Distance of the base, position and quaternion wxyz (7,), from the reference."""
        x, y, _ = self._poses[command].tolist()
        return math.hypot(x - float(base[0]), y - float(base[1]))

    def wheel_rates(self, command: int, base: NDArray[np.float64]) -> tuple[float, float]:
        """Rates of the left and the right wheels in rad/s at a command.

        Args:
            command: index of the command.
            base: (7,) true position and quaternion wxyz of the robot's base.
        """
        x_m, y_m, _, w, i, j, k = base.tolist()
        yaw = math.atan2(2.0 * (w * k + i * j), 1.0 - 2.0 * (j * j + k * k))
        x, y, wanted_yaw = self._poses[command].tolist()
        vx, vy, turn_rate = self._rates[command].tolist()
        speed = vx * math.cos(wanted_yaw) + vy * math.sin(wanted_yaw)
        cos, sin = math.cos(yaw), math.sin(yaw)
        ahead = cos * (x - x_m) + sin * (y - y_m)
        left = cos * (y - y_m) - sin * (x - x_m)
        off = wrap_angle(wanted_yaw - yaw)
        limits = self._rover.kinematics
        speed = _limited(speed * math.cos(off) + AHEAD_PER_S * ahead, limits.max_speed_mps)
        turn_rate += TURN_PER_M2 * speed * left + TURN_PER_S * off
        turn_rate = _limited(turn_rate, limits.max_turn_rate_radps)
        difference = 0.5 * self._rover.effective_track_m * turn_rate
        radius = self._rover.wheel_radius_m
        return (speed - difference) / radius, (speed + difference) / radius


def _limited(rate: float, limit: float) -> float:
    return max(-RESERVE * limit, min(RESERVE * limit, rate))
