"""EuRoC: 17 columns separated by commas: ns, position, quaternion wxyz, velocity, IMU biases.

Velocity and biases are not read. For a trajectory, the velocities of the smooth motion through its
poses are written, and biases of 0.
Source: EuRoC MAV dataset, state_groundtruth_estimate0/data.csv.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

import numpy as np

from omnisim.core.arrays import Floats
from omnisim.core.poses import quaternion_from_rotation
from omnisim.core.trajectories.body_motion import SplineMotion
from omnisim.core.trajectories.formats.parsed_trajectory import (
    ParsedTrajectory,
    TextTable,
    check_printed_times,
    is_number,
    parsed_trajectory,
    quote,
    rotations_from_quaternions,
)
from omnisim.core.trajectories.trajectory import Trajectory

STAMP = re.compile(r"\d{1,19}", re.ASCII)
COLUMNS = (
    ["timestamp"]
    + [f"p_{axis}" for axis in "xyz"]
    + [f"q_{axis}" for axis in "wxyz"]
    + [f"{vector}_{axis}" for vector in ("v", "b_w", "b_a") for axis in "xyz"]
)
UNITS = ["ns"] + ["m"] * 3 + [""] * 4 + ["m s^-1"] * 3 + ["rad s^-1"] * 3 + ["m s^-2"] * 3


def read(table: TextTable) -> ParsedTrajectory:
    """Read a table of 17 columns, with or without a header."""
    if not is_number(table.lines[0].cells[0]):
        table = table.without_header()
    numbers = table.numbers(COLUMNS)
    for line in table.lines:
        if not STAMP.fullmatch(line.cells[0]):
            stamp = quote(line.cells[0])
            raise table.fault(line, f"timestamp = {stamp}: expected whole nanoseconds")
    stamps = [int(line.cells[0]) for line in table.lines]
    times_s = np.array([stamp / 1_000_000_000 for stamp in stamps])
    table.check_times(times_s, [f"{stamp} ns" for stamp in stamps])
    rotations = rotations_from_quaternions(table, numbers[:, (5, 6, 7, 4)])
    return parsed_trajectory(table, times_s, numbers[:, 1:4], rotations)


def lines(trajectory: Trajectory) -> Iterator[str]:
    """Lines of a trajectory file."""
    check_printed_times(trajectory.times_s)
    stamps_ns = [round(time_s * 1e9) for time_s in trajectory.times_s.tolist()]
    velocities = SplineMotion(trajectory).at(trajectory.times_s).velocity_mps
    return state_lines(stamps_ns, trajectory.world_from_base, velocities)


def state_lines(
    stamps_ns: Sequence[int], poses: Floats, velocities_mps: Floats, biases: Floats | None = None
) -> Iterator[str]:
    """Lines of a file with states: poses (n, 4, 4), velocities (n, 3), biases (n, 6) or 0."""
    names = (f"{name} [{unit}]" for name, unit in zip(COLUMNS, UNITS, strict=True))
    yield "#" + ",".join(names)
    quaternions = quaternion_from_rotation(poses[:, :3, :3])[:, (3, 0, 1, 2)]
    rows = np.column_stack((poses[:, :3, 3], quaternions, velocities_mps)).tolist()
    walks = [["0"] * 6] * len(rows)
    if biases is not None:
        walks = [[f"{value:.9f}" for value in row] for row in biases.tolist()]
    for stamp_ns, row, bias in zip(stamps_ns, rows, walks, strict=True):
        yield ",".join([str(stamp_ns), *(f"{value:.9f}" for value in row), *bias])
