"""Closely spaced poses of the base along a trajectory, including the trajectory's own poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy  # its submodules load when first used
from numpy.typing import NDArray

from omnisim.core.poses import pose_from_rotation
from omnisim.core.short_repr import counted, short_repr
from omnisim.core.trajectories import Trajectory
from omnisim.robots.kinematics import steps_between

SPACING_M = 0.05  # spacing of the outermost corner between poses
MAX_PER_STEP = 200  # poses: a longer step is a jump, not a drive


@dataclass(frozen=True, eq=False)
class Sweep:
    """Poses along a trajectory.

    Attributes:
        world_from_base: (m, 4, 4) poses of the base.
        steps: (m,) index of the trajectory's pose at or before each pose.
        is_step: (m,) true for the trajectory's own poses, which stay unchanged.
        times_s: (m,) times of the poses.
    """

    world_from_base: NDArray[np.float64]
    steps: NDArray[np.intp]
    is_step: NDArray[np.bool_]
    times_s: NDArray[np.float64]

    def __repr__(self) -> str:
        return short_repr(self, counted(len(self.steps), "pose"))

    @property
    def trajectory(self) -> Trajectory:
        """Trajectory whose poses are the steps."""
        return Trajectory(self.times_s[self.is_step], self.world_from_base[self.is_step])

    @classmethod
    def along(cls, trajectory: Trajectory, reach_m: float) -> Sweep:
        """Interpolate poses within the steps: positions linearly, rotations by slerp.

        Args:
            trajectory: trajectory to interpolate.
            reach_m: distance from the base to its outermost corner.
        """
        poses, times = trajectory.world_from_base, trajectory.times_s
        if len(trajectory) == 1:
            return cls(poses, np.zeros(1, dtype=np.intp), np.ones(1, dtype=bool), times)
        moved = steps_between(poses)
        arcs_m = np.abs(moved.distances_m) + reach_m * np.abs(moved.turns_rad)
        counts = np.clip(np.ceil(arcs_m / SPACING_M), 1.0, MAX_PER_STEP).astype(np.intp)
        counts = np.append(counts, 1)  # the last pose
        steps = np.repeat(np.arange(len(poses)), counts)
        within = np.arange(len(steps)) - np.repeat(np.cumsum(counts) - counts, counts)
        shares = within / counts[steps]
        at = steps + shares
        positions = poses[:, :3, 3]
        between = np.column_stack([np.interp(at, range(len(poses)), axis) for axis in positions.T])
        rotations = scipy.spatial.transform.Rotation.from_matrix(poses[:, :3, :3])
        turned = scipy.spatial.transform.Slerp(np.arange(len(poses)), rotations)(at).as_matrix()
        filled = pose_from_rotation(turned, between)
        filled[within == 0] = poses
        stamps = np.interp(at, range(len(poses)), times)
        stamps[within == 0] = times
        return cls(filled, steps, within == 0, stamps)
