"""TUM: `t x y z qx qy qz qw` in seconds and meters, separated by blanks.

Names of image files may take the place of the times: `0001.png x y z qx qy qz qw`.

Source: TUM RGB-D benchmark, file formats.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np

from omnisim.core.poses import quaternion_from_rotation
from omnisim.core.trajectories.formats.parsed_trajectory import (
    ParsedTrajectory,
    TextTable,
    check_printed_times,
    checked_times,
    is_file_name,
    parsed_trajectory,
    rotations_from_quaternions,
)
from omnisim.core.trajectories.trajectory import Trajectory

COLUMNS = ["t", "x", "y", "z", "qx", "qy", "qz", "qw"]


def read(table: TextTable) -> ParsedTrajectory:
    """Read a table of 8 columns."""
    if is_file_name(table.lines[0].cells[0]):
        table, names = table.without_column(0)
        numbers = table.numbers(COLUMNS[1:])
        rotations = rotations_from_quaternions(table, numbers[:, 3:])
        parsed = parsed_trajectory(table, None, numbers[:, :3], rotations)
        return dataclasses.replace(parsed, names=names)
    numbers = table.numbers(COLUMNS)
    times_s = checked_times(table, numbers[:, 0])
    return parsed_trajectory(
        table, times_s, numbers[:, 1:4], rotations_from_quaternions(table, numbers[:, 4:])
    )


def lines(trajectory: Trajectory) -> Iterator[str]:
    """Lines of a trajectory file."""
    check_printed_times(trajectory.times_s)
    yield "# " + " ".join(COLUMNS)
    quaternions = quaternion_from_rotation(trajectory.world_from_base[:, :3, :3])
    numbers = np.column_stack((trajectory.times_s, trajectory.positions_m, quaternions))
    for row in numbers:
        yield " ".join(f"{value:.9f}" for value in row)
