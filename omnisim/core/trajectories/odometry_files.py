"""Odometry files: a CSV of readings, and of poses by dead reckoning.

The columns are `t_s,distance_m,turn_rad,x_m,y_m,yaw_rad`. Distance and turn are counted from the
previous line, and are 0 in the first. Numbers have nine digits after the point.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from omnisim.core.poses import MAX_M, wrap_angle
from omnisim.core.trajectories.formats.parsed_trajectory import read_times
from omnisim.core.trajectories.formats.text_table import check_printed_times, read_text_table
from omnisim.core.trajectories.odometry import Odometry
from omnisim.core.trajectories.trajectory_files import write_lines

COLUMNS = ["t_s", "distance_m", "turn_rad", "x_m", "y_m", "yaw_rad"]
# A pose must follow from the previous one by the reading, up to the rounding of printed numbers.
AGREEMENT = 1e-8


def write_odometry(path: Path, odometry: Odometry) -> None:
    """Write readings and dead-reckoned poses atomically.

    Raises:
        TrajectoryError: times are equal when printed in nanoseconds.
        OutputError: the file cannot be written.
    """
    check_printed_times(odometry.times_s)
    readings = np.column_stack((odometry.distances_m, odometry.turns_rad))
    readings = np.concatenate((np.zeros((1, 2)), readings))
    rows = np.column_stack((odometry.times_s, readings, odometry.planar_poses))
    lines = (",".join(f"{value:.9f}" for value in row) for row in rows)
    write_lines(path, [",".join(COLUMNS), *lines])


def read_odometry(path: Path) -> Odometry:
    """Read a file written by `write_odometry`.

    Raises:
        TrajectoryError: the file is invalid, or its poses do not follow from its readings; names
            file, line, actual and expected value.
    """
    table = read_text_table(path)
    if table.lines[0].cells != COLUMNS:
        columns = ",".join(table.lines[0].cells)
        raise table.fault(table.lines[0], f"header {columns[:60]!r}: expected {','.join(COLUMNS)}")
    table = table.without_header()
    numbers = table.numbers(COLUMNS)
    times_s = read_times(table, numbers[:, 0])
    far = np.any(np.abs(numbers) >= MAX_M, axis=1)
    if np.any(far):
        raise table.fault(table.lines[int(np.argmax(far))], f"expected numbers below {MAX_M:g}")
    readings, poses = numbers[:, 1:3], numbers[:, 3:]
    if np.any(readings[0] != 0.0):
        raise table.fault(
            table.lines[0],
            f"first line: expected distance and turn 0, got {readings[0, 0]:g} m, "
            f"{readings[0, 1]:g} rad",
        )
    for k in range(1, len(poses)):
        step = Odometry(
            times_s[k - 1 : k + 1], readings[k, :1], readings[k, 1:], tuple(poses[k - 1])
        )
        off = poses[k] - step.planar_poses[1]
        off[2] = wrap_angle(off[2])
        if np.max(np.abs(off)) > AGREEMENT * (1.0 + np.max(np.abs((*poses[k], *readings[k])))):
            raise table.fault(
                table.lines[k],
                f"pose {math.hypot(off[0], off[1]):.3g} m and {abs(off[2]):.3g} rad off what its "
                "reading leads to: expected poses by dead reckoning along arcs",
            )
    return Odometry(times_s, readings[1:, 0], readings[1:, 1], tuple(poses[0].tolist()))
