"""Where the robot is between the poses of a trajectory."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.poses import interpolate
from omnisim.robot.trajectory import Trajectory


def pose_at(trajectory: Trajectory, time_s: float) -> NDArray[np.float64]:
    """The pose (4, 4) world_from_base at a time; at rest before the first and after the last.

    Between two poses the robot drives straight at an even speed, and turns evenly about one axis:
    all that is known of it. For legs and turns on the spot this is the true path.
    """
    times, poses = trajectory.times_s, trajectory.world_from_base
    step = int(np.searchsorted(times, time_s, side="right")) - 1
    if step < 0 or step >= len(times) - 1:
        return poses[0 if step < 0 else -1].copy()
    share = (time_s - times[step]) / (times[step + 1] - times[step])
    if share == 0.0:
        return poses[step].copy()
    return interpolate(poses[step], poses[step + 1], share)
