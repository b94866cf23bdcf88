"""Trajectories: poses by time, and their files."""

from omnisim.trajectories.files import parse_trajectory, read_trajectory, write_trajectory
from omnisim.trajectories.trajectory import Trajectory, check_continuous

__all__ = [
    "Trajectory",
    "check_continuous",
    "parse_trajectory",
    "read_trajectory",
    "write_trajectory",
]
