"""KITTI: the upper three rows of a pose, 12 numbers per line separated by blanks, without times.

The numbers are read unchanged. The benchmark's poses are those of a camera: x right, y down, z
forward; `omnisim.core.trajectories.trajectory_files` applies this convention.
Source: KITTI odometry benchmark, development kit.
"""

from __future__ import annotations

from collections.abc import Iterator

from omnisim.core.trajectories.formats.parsed_trajectory import (
    ParsedTrajectory,
    TextTable,
    parsed_trajectory,
    rotations_from_matrices,
)
from omnisim.core.trajectories.trajectory import Trajectory

COLUMNS = [f"{name}{row}" for row in "012" for name in ("x", "y", "z", "t")]


def read(table: TextTable) -> ParsedTrajectory:
    """Read a table of 12 columns."""
    matrices = table.numbers(COLUMNS).reshape(-1, 3, 4)
    return parsed_trajectory(
        table, None, matrices[:, :, 3], rotations_from_matrices(table, matrices[:, :, :3])
    )


def lines(trajectory: Trajectory) -> Iterator[str]:
    """Lines of a trajectory file, without times."""
    for row in trajectory.world_from_base[:, :3].reshape(-1, 12):
        yield " ".join(f"{value:.9f}" for value in row)
