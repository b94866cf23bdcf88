"""Trajectories: poses over time, and their files."""

from omnisim.core.trajectories.trajectory import Trajectory, check_continuous
from omnisim.core.trajectories.trajectory_files import (
    parse_trajectory,
    read_trajectory,
    write_trajectory,
)

__all__ = [
    "Trajectory",
    "check_continuous",
    "parse_trajectory",
    "read_trajectory",
    "write_trajectory",
]
