"""Paths as waypoints: corners that a robot visits in order."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from omnisim.core.errors import TrajectoryError
from omnisim.core.poses import MAX_M
from omnisim.core.trajectories.formats.parsed_trajectory import read_text_table


def check_waypoints(waypoints_m: ArrayLike) -> NDArray[np.float64]:
    """Check waypoints and return them as float64 (n, 2).

    Raises:
        TrajectoryError: not (n, 2) with n ≥ 2, not finite, or a waypoint repeats the previous one.
    """
    try:
        points = np.array(waypoints_m, dtype=np.float64)
    except (TypeError, ValueError):
        raise TrajectoryError("waypoints: expected a list of [x, y] in meters") from None
    if points.shape in ((0,), (1, 2)):
        raise TrajectoryError(f"waypoints: expected at least 2, got {len(points)}")
    if points.ndim != 2 or points.shape[1] != 2:
        raise TrajectoryError(f"waypoints of shape {points.shape}: expected (n, 2)")
    finite = np.all(np.abs(points) < MAX_M, axis=1)  # also false for NaN
    if not np.all(finite):
        k = int(np.argmin(finite))
        raise TrajectoryError(
            f"waypoint {k} {points[k].tolist()}: expected finite numbers in meters"
        )
    same = np.all(points[1:] == points[:-1], axis=1)
    if np.any(same):
        k = int(np.argmax(same))
        raise TrajectoryError(f"waypoints {k} and {k + 1} are the same: expected one of them")
    return points


def read_waypoints(path: Path) -> NDArray[np.float64] | None:
    """Read waypoints (n, 2) from a CSV file with exactly the columns x_m and y_m.

    Any other file returns None: with headings or times it is a trajectory.

    Raises:
        TrajectoryError: the file is invalid; names file, line, actual and expected text.
    """
    table = read_text_table(path)
    names = table.lines[0].cells
    if sorted(names) != ["x_m", "y_m"]:
        return None
    numbers = table.without_header().numbers(names)
    try:
        return check_waypoints(numbers[:, [names.index("x_m"), names.index("y_m")]])
    except TrajectoryError as reason:
        raise TrajectoryError(f"{path}: {reason}") from None
