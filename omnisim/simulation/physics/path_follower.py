"""Path following: wheel speeds that keep a robot on its planned trajectory."""

from __future__ import annotations

import math

import numpy as np
import scipy  # its submodules load when first used
from numpy.typing import NDArray

from omnisim.poses import wrap_angle
from omnisim.simulation.physics.rover import Rover
from omnisim.trajectories import Trajectory

REST_S = 1.0  # before and after the trajectory
AHEAD_PER_S, TURN_PER_S = 4.0, 6.0  # corrections along the path, and of the heading
TURN_PER_M2 = 16.0  # turn for each metre ahead and metre to the side
RESERVE = 1.25  # of the limits, to catch up


class PathFollower:
    """Tracking controller that knows the robot's true pose.

    Between the poses of the trajectory the reference is a monotone cubic, which neither overshoots
    nor cuts corners, and is exact while acceleration is even; the robot rests at both ends.

    Source: Kanayama et al., "A stable tracking control method for an autonomous mobile robot", ICRA
    1990, with a correction of the heading that does not vanish at rest.

    Args:
        trajectory: planned, of which x, y and yaw count.
        rover: that drives.
        times_s: (n,) of the commands.
    """

    def __init__(self, trajectory: Trajectory, rover: Rover, times_s: NDArray[np.float64]):
        ends = trajectory.times_s[[0, -1]] + (-REST_S, REST_S)
        stamps = np.concatenate((ends[:1], trajectory.times_s, ends[1:]))
        planar = np.column_stack((trajectory.positions_m[:, :2], np.unwrap(trajectory.yaw_rad)))
        planar = np.concatenate((planar[:1], planar, planar[-1:]))
        times_s = np.clip(times_s, *ends)
        curve = scipy.interpolate.CubicHermiteSpline(stamps, planar, _slopes(stamps, planar))
        self._poses = curve(times_s)
        self._rates = curve(times_s, 1)
        self._rover = rover

    def distance_m(self, command: int, base: NDArray[np.float64]) -> float:
        """Distance of the base, position and quaternion wxyz (7,), from the reference."""
        x, y, _ = self._poses[command].tolist()
        return math.hypot(x - float(base[0]), y - float(base[1]))

    def wheel_rates(self, command: int, base: NDArray[np.float64]) -> tuple[float, float]:
        """Rates of the left and the right wheels in rad/s at a command.

        Args:
            command: number of its time.
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


def _slopes(times_s: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Slopes (n, k) at values (n, k): of parabolas through three, where monotone; the ends rest.

    Source: Fritsch and Carlson, "Monotone piecewise cubic interpolation", SIAM J. Numer. Anal. 17
    (1980): a slope of at most three times those of the chords beside it.
    """
    steps_s = np.diff(times_s)[:, None]
    chords = np.diff(values, axis=0) / steps_s
    before, after = chords[:-1], chords[1:]
    parabolas = (before * steps_s[1:] + after * steps_s[:-1]) / (steps_s[1:] + steps_s[:-1])
    most = 3.0 * np.minimum(np.abs(before), np.abs(after))
    slopes = np.zeros_like(values)
    slopes[1:-1] = np.where(before * after > 0.0, np.clip(parabolas, -most, most), 0.0)
    return slopes


def _limited(rate: float, limit: float) -> float:
    return max(-RESERVE * limit, min(RESERVE * limit, rate))
