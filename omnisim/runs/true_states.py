"""True states of a run's base at the times of all measurements, in one file."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from omnisim.core.arrays import Floats
from omnisim.core.errors import RunError
from omnisim.core.files.number_files import BLOCK, write_table
from omnisim.core.poses import (
    pose_from_rotation,
    quaternion_from_rotation,
    rotation_from_quaternion,
)
from omnisim.core.rate import printed_s
from omnisim.core.trajectories.body_motion import BodyMotion, MotionStates
from omnisim.core.trajectories.trajectory import MAX_S

COLUMNS = (
    "t_s,x_m,y_m,z_m,qx,qy,qz,qw,vx_mps,vy_mps,vz_mps,ax_mps2,ay_mps2,az_mps2,"
    "wx_radps,wy_radps,wz_radps"
)


def write_states(path: Path, motion: BodyMotion, times_s: Iterable[Floats]) -> None:
    """Write the base's states at given times.

    A state is position, orientation, velocity and acceleration in the world, and the angular rate
    in the base's frame.

    Args:
        path: path of the file.
        motion: motion of the base.
        times_s: times of the steps and of each sensor's measurements; times before the motion are
            ignored.

    Raises:
        OutputError: the file cannot be written.
    """
    times = np.unique(np.concatenate([printed_s(one) for one in times_s]))
    times = times[times >= printed_s(np.array([motion.start_s]))]
    parts = (times[first : first + BLOCK] for first in range(0, len(times), BLOCK))
    write_table(path, COLUMNS, (_rows(part, motion.at(part)) for part in parts))


def _rows(times_s: Floats, states: MotionStates) -> Floats:
    quaternions = quaternion_from_rotation(states.world_from_base[:, :3, :3])
    return np.column_stack((times_s, states.world_from_base[:, :3, 3], quaternions, *states[1:]))


def write_state(path: Path, time_s: float, state: MotionStates) -> None:
    """Write one state, whose arrays have one row, at the time of a sensor's own clock.

    Raises:
        OutputError: the file cannot be written.
    """
    write_table(path, COLUMNS, iter((_rows(np.array([time_s]), state),)))


def read_states(path: Path) -> tuple[Floats, MotionStates]:
    """Read times (n,) and states.

    Raises:
        RunError: the file cannot be read, or is damaged.
    """
    try:
        with path.open(encoding="utf-8") as file:
            head = file.readline().rstrip("\n")
            table = np.array([line.split(",") for line in file], dtype=np.float64)
    except OSError as reason:
        raise RunError(f"{path}: cannot be read: {reason.strerror}") from None
    except ValueError:
        raise RunError(f"{path}: is damaged: expected numbers between commas") from None
    width = len(COLUMNS.split(","))
    is_known = table.shape == (len(table), width) and np.all(np.abs(table) < MAX_S)
    if head != COLUMNS or not len(table) or not is_known:  # also false for NaN
        raise RunError(f"{path}: expected the columns {COLUMNS} and finite numbers")
    norms = np.linalg.norm(table[:, 4:8], axis=1)
    if not np.all(np.diff(table[:, 0]) > 0.0) or np.any(np.abs(norms - 1.0) > 1e-6):
        raise RunError(f"{path}: expected times that increase, and unit quaternions")
    poses = pose_from_rotation(rotation_from_quaternion(table[:, 4:8]), table[:, 1:4])
    return table[:, 0], MotionStates(poses, table[:, 8:11], table[:, 11:14], table[:, 14:17])
