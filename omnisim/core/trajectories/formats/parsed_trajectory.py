"""Poses parsed from a trajectory file, with times if the file has them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import TrajectoryError
from omnisim.core.poses import (
    MAX_M,
    is_rotation,
    nearest_rotation,
    pose_from_rotation,
    rotation_from_quaternion,
)
from omnisim.core.trajectories.formats.text_table import TextTable
from omnisim.core.trajectories.trajectory import MAX_S, Trajectory

# A quaternion or matrix printed with a few digits, or rounded to float32, is well within this.
ROUNDING = 1e-3
# "world": x forward, y left, z up (REP 103); "kitti": x right, y down, z forward, for the pose at
# the origin and for all others (KITTI odometry benchmark, development kit).
Axes = Literal["world", "kitti"]


@dataclass(frozen=True, eq=False)
class ParsedTrajectory:
    """Poses in a file, with or without times.

    Attributes:
        source: file name, for messages.
        line_numbers: (n,) line of each pose in the file, counted from 1.
        times_s: (n,) times, or None if the file has none.
        world_from_base: (n, 4, 4) poses in world axes.
        axes: axes of the poses in the file.
        has_heights: False for poses on a floor plan: x, y and heading.
        format: name of the file format.
        names: (n,) image file of each pose, or None if the file has no names.
    """

    source: str
    line_numbers: NDArray[np.intp]
    times_s: NDArray[np.float64] | None
    world_from_base: NDArray[np.float64]
    axes: Axes = "world"
    has_heights: bool = True
    format: str = ""
    names: tuple[str, ...] | None = None

    def trajectory(self, rate_hz: float | None = None) -> Trajectory:
        """Trajectory at the poses' times; poses without times are spaced at `rate_hz` from 0 s.

        Raises:
            TrajectoryError: there are neither times nor a rate, or there are both.
        """
        if rate_hz is None:
            if self.times_s is None:
                raise TrajectoryError(
                    f"{self.source}: has no times: expected a rate in Hz, or a robot that drives it"
                )
            return Trajectory(self.times_s, self.world_from_base)
        if self.times_s is not None:
            raise TrajectoryError(f"{self.source}: has times of its own: expected no rate")
        count = len(self.world_from_base)
        if not (math.isfinite(rate_hz) and rate_hz > 0.0 and count < MAX_S * rate_hz):
            raise TrajectoryError(f"rate {rate_hz:g} Hz: expected a finite number above 0")
        return Trajectory(np.arange(count) / rate_hz, self.world_from_base)


def parsed_trajectory(
    table: TextTable,
    times_s: NDArray[np.float64] | None,
    positions_m: NDArray[np.float64],
    rotations: NDArray[np.float64],
) -> ParsedTrajectory:
    """Assemble poses that a format module has read from a table, one per line.

    Args:
        table: table of the file.
        times_s: (n,) times, or None.
        positions_m: (n, 3) positions.
        rotations: (n, 3, 3) rotations.

    Raises:
        TrajectoryError: a position is too far away.
    """
    _refuse(
        table,
        np.all(np.abs(positions_m) < MAX_M, axis=1),
        lambda k: f"position {positions_m[k].tolist()}: expected less than {MAX_M:g} m",
    )
    poses = pose_from_rotation(rotations, positions_m)
    return ParsedTrajectory(
        table.source, np.array([line.number for line in table.lines]), times_s, poses
    )


def read_times(table: TextTable, times_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Validated times (n,) from a table's first column.

    Raises:
        TrajectoryError: times are too large, or do not increase.
    """
    for line, time in zip(table.lines, times_s, strict=True):
        if abs(time) >= MAX_S:
            raise table.fault(line, f"time {time:g} s: expected less than {MAX_S:g} s")
    table.check_times(times_s, [f"{time:.9g} s" for time in times_s])
    return times_s


def read_quaternions(table: TextTable, xyzw: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotations (n, 3, 3) from a table's quaternions (n, 4).

    Raises:
        TrajectoryError: the length of a quaternion differs from 1 by more than rounding.
    """
    lengths = np.linalg.norm(xyzw, axis=-1)
    _refuse(
        table,
        np.abs(lengths - 1.0) <= ROUNDING,
        lambda k: f"quaternion of length {lengths[k]:.6g}: expected 1 (within {ROUNDING:g})",
    )
    return rotation_from_quaternion(xyzw)


def read_rotations(table: TextTable, matrices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotations (n, 3, 3) from a table's matrices, with rounding errors removed.

    Raises:
        TrajectoryError: a matrix differs from a rotation by more than rounding.
    """
    _refuse(
        table,
        is_rotation(matrices, ROUNDING),
        lambda k: (
            f"the matrix scales, shears or mirrors: expected a rotation (within {ROUNDING:g})"
        ),
    )
    return nearest_rotation(matrices)


def _refuse(table: TextTable, good: NDArray[np.bool_], message: Callable[[int], str]) -> None:
    if not np.all(good):
        k = int(np.argmin(good))
        raise table.fault(table.lines[k], message(k))
