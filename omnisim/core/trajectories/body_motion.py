"""Motion of a body: its pose, velocity and angular rate at any time.

All sensors of a robot use the same motion: images and their shutters, lidars, IMUs, odometry and
ground truth. If a plan made the drive, the plan is the motion (`omnisim.robots.motion_profile`);
otherwise it is a spline through poses (`spline_motion`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np

from omnisim.core.arrays import Floats


class MotionStates(NamedTuple):
    """States of a body at given times."""

    world_from_base: Floats  # (n, 4, 4) poses
    velocity_mps: Floats  # (n, 3) velocity of the base's origin, world
    # (n, 3) acceleration of the base's origin, world; one-sided where it jumps
    acceleration_mps2: Floats
    angular_rate_radps: Floats  # (n, 3) angular rate, base

    def at_mount(self, base_from_mount: Floats) -> MotionStates:
        """States of a frame mounted on the body at `base_from_mount` (4, 4).

        The acceleration lacks the lever-arm part, which jumps with the angular acceleration.
        """
        lever_m = base_from_mount[:3, 3]
        swing = np.cross(self.angular_rate_radps, lever_m)
        rotations = self.world_from_base[:, :3, :3]
        return MotionStates(
            self.world_from_base @ base_from_mount,
            self.velocity_mps + np.einsum("nij,nj->ni", rotations, swing),
            self.acceleration_mps2,
            self.angular_rate_radps @ base_from_mount[:3, :3],
        )


class BodyMotion(ABC):
    """Motion of a body from start to end; before and after, the body rests."""

    # start_s, end_s: first and last time
    start_s: float
    end_s: float

    def at(self, times_s: Floats) -> MotionStates:
        """States at times (n,)."""
        times = np.asarray(times_s, dtype=np.float64)
        states = self._states(np.clip(times, self.start_s, self.end_s))
        moves = ((times >= self.start_s) & (times <= self.end_s))[:, None]
        rates = (np.where(moves, rate, 0.0) for rate in states[1:])
        return MotionStates(states.world_from_base, *rates)

    def pose_at(self, time_s: float) -> Floats:
        """Pose (4, 4) at a time."""
        return self.at(np.array([time_s])).world_from_base[0]

    @abstractmethod
    def _states(self, times_s: Floats) -> MotionStates:
        """States at times (n,) between start and end."""
