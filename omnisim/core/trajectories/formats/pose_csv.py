"""omnisim's own CSV: a header, then one pose per line; the columns are in any order.

`x_m` and `y_m` are required. `z_m`, `roll_deg` and `pitch_deg` default to 0; without all three, the
poses lie on a floor plan. Without `yaw_deg` the robot looks along its path, toward the next
distinct position, and at the end it keeps its heading. Without `t_s` the poses have no times.
`image` may name the image file of each pose.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np

from omnisim.core.arrays import Floats
from omnisim.core.errors import did_you_mean
from omnisim.core.poses import roll_pitch_yaw_from_rotation, rotation_from_roll_pitch_yaw
from omnisim.core.trajectories.formats.parsed_trajectory import (
    ParsedTrajectory,
    TextTable,
    check_printed_times,
    checked_times,
    parsed_trajectory,
    quote,
)
from omnisim.core.trajectories.trajectory import Trajectory

COLUMNS = ["t_s", "x_m", "y_m", "z_m", "yaw_deg", "roll_deg", "pitch_deg"]
IMAGE_COLUMN = "image"


def read(table: TextTable) -> ParsedTrajectory:
    """Read a table whose first line names its columns."""
    names = _header(table)
    table = table.without_header()
    images = None
    if IMAGE_COLUMN in names:
        table, images = table.without_column(names.index(IMAGE_COLUMN))
        names = [name for name in names if name != IMAGE_COLUMN]
    values = dict(zip(names, table.numbers(names).T, strict=True))
    zeros = np.zeros(len(table.lines))
    positions = np.column_stack((values["x_m"], values["y_m"], values.get("z_m", zeros)))
    roll, pitch = (np.radians(values.get(name, zeros)) for name in ("roll_deg", "pitch_deg"))
    yaw = np.radians(values["yaw_deg"]) if "yaw_deg" in values else heading_along(positions[:, :2])
    rotations = np.array(
        [rotation_from_roll_pitch_yaw(*angles) for angles in zip(roll, pitch, yaw, strict=True)]
    )
    times_s = checked_times(table, values["t_s"]) if "t_s" in values else None
    parsed = parsed_trajectory(table, times_s, positions, rotations)
    has_heights = any(name in values for name in ("z_m", "roll_deg", "pitch_deg"))
    return dataclasses.replace(parsed, has_heights=has_heights, names=images)


def _header(table: TextTable) -> list[str]:
    line = table.lines[0]
    for k, name in enumerate(line.cells):
        if name not in (*COLUMNS, IMAGE_COLUMN):
            hint = did_you_mean(name, COLUMNS)
            raise table.fault(line, f"column {quote(name)!r}: {hint}")
        if name in line.cells[:k]:
            raise table.fault(line, f"column {name!r} appears twice: expected it once")
    missing = [name for name in ("x_m", "y_m") if name not in line.cells]
    if missing:
        raise table.fault(line, f"no column {missing[0]!r}: expected at least x_m and y_m")
    return line.cells


def heading_along(positions_m: Floats) -> Floats:
    """Headings (n,) in radians along a path (n, 2), toward the next distinct position.

    The last positions keep the previous heading; it is 0 if all positions are equal.
    """
    steps = np.diff(positions_m, axis=0)
    moving = np.flatnonzero(np.any(steps != 0.0, axis=1))
    if not len(moving):
        return np.zeros(len(positions_m))
    headings: Floats = np.arctan2(steps[moving, 1], steps[moving, 0])
    following = np.searchsorted(moving, np.arange(len(positions_m)))
    return headings[np.minimum(following, len(moving) - 1)]


def lines(trajectory: Trajectory) -> Iterator[str]:
    """Lines of a trajectory file, with all columns."""
    check_printed_times(trajectory.times_s)
    yield ",".join(COLUMNS)
    angles = roll_pitch_yaw_from_rotation(trajectory.world_from_base[:, :3, :3])
    degrees = np.degrees(angles)[:, (2, 0, 1)]
    for row in np.column_stack((trajectory.times_s, trajectory.positions_m, degrees)):
        yield ",".join(f"{value:.9f}" for value in row)
