"""Smooth motion through the poses of a trajectory: with velocities and accelerations.

Pictures are taken of straight and even motion from pose to pose, whose velocity jumps at the poses.
What measures accelerations needs a motion without such jumps. Both go through the same poses.

Source: de Boor, "A Practical Guide to Splines" (1978): natural cubic splines. SciPy's
RotationSpline: the same for rotations, with rates that are even in the body's frame.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy  # its submodules load when first used
from numpy.typing import NDArray

from omnisim.trajectories.trajectory import Trajectory


class Kinematics(NamedTuple):
    """Motion of the base at some times.

    Attributes:
        world_from_base: rotations (n, 3, 3).
        acceleration_mps2: (n, 3) of the base's origin, world.
        angular_rate_radps: (n, 3), base.
        angular_acceleration_radps2: (n, 3), base.
    """

    world_from_base: NDArray[np.float64]
    acceleration_mps2: NDArray[np.float64]
    angular_rate_radps: NDArray[np.float64]
    angular_acceleration_radps2: NDArray[np.float64]


class SmoothMotion:
    """Twice differentiable motion through the poses of a trajectory.

    Accelerations are continuous and at the first and the last pose zero; beyond them the motion is
    not defined. A robot that stops between poses far apart swings about its place by a little.

    Args:
        trajectory: of two poses or more; a single one is at rest.
    """

    def __init__(self, trajectory: Trajectory):
        self._start_s = float(trajectory.times_s[0])
        times, poses = trajectory.times_s - self._start_s, trajectory.world_from_base
        if len(times) == 1:
            times, poses = np.array([0.0, 1.0]), np.repeat(poses, 2, axis=0)
        self._end_s = float(times[-1])
        rotations = scipy.spatial.transform.Rotation.from_matrix(poses[:, :3, :3])
        self._position = scipy.interpolate.CubicSpline(times, poses[:, :3, 3], bc_type="natural")
        self._rotation = scipy.spatial.transform.RotationSpline(times, rotations)

    def positions_m(self, times_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Positions (n, 3) of the base in the world at times (n,)."""
        positions: NDArray[np.float64] = self._position(self._since_start(times_s))
        return positions

    def velocities_mps(self, times_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Velocities (n, 3) of the base in the world at times (n,)."""
        velocities: NDArray[np.float64] = self._position(self._since_start(times_s), 1)
        return velocities

    def at(self, times_s: NDArray[np.float64]) -> Kinematics:
        """Kinematics at times (n,)."""
        times = self._since_start(times_s)
        return Kinematics(
            self._rotation(times).as_matrix(),
            self._position(times, 2),
            self._rotation(times, 1),
            self._rotation(times, 2),
        )

    def _since_start(self, times_s: NDArray[np.float64]) -> NDArray[np.float64]:
        times: NDArray[np.float64] = np.clip(times_s - self._start_s, 0.0, self._end_s)
        return times
