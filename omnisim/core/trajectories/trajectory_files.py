"""Trajectory files: TUM, KITTI, EuRoC, and omnisim's own CSV (`formats/`)."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Protocol, get_args

import numpy as np

from omnisim.core.arrays import Floats
from omnisim.core.coordinate_frames import BASE_FROM_OPTICAL_LOOKING_AHEAD
from omnisim.core.errors import TrajectoryError
from omnisim.core.files.atomic_file import check_target, write_text
from omnisim.core.poses import inverse, pose_from_rotation
from omnisim.core.trajectories.formats import euroc, kitti, pose_csv, tum
from omnisim.core.trajectories.formats.parsed_trajectory import (
    Axes,
    ParsedTrajectory,
    TextTable,
    is_file_name,
    is_number,
    quote,
    read_text_table,
)
from omnisim.core.trajectories.trajectory import Trajectory, check_continuous


class TrajectoryFormat(Protocol):
    """Interface of a format module."""

    def read(self, table: TextTable) -> ParsedTrajectory:
        """Read the poses of a table."""

    def lines(self, trajectory: Trajectory) -> Iterator[str]:
        """Lines of a trajectory file."""


FORMATS: dict[str, TrajectoryFormat] = {"tum": tum, "kitti": kitti, "euroc": euroc, "csv": pose_csv}
# The base stands in for the camera: files do not say where it is mounted.
_FROM_KITTI = pose_from_rotation(BASE_FROM_OPTICAL_LOOKING_AHEAD, np.zeros(3))
WANTED = (
    f"expected 8 space-separated columns (TUM) or 12 (KITTI), 17 comma-separated ones (EuRoC), "
    f"or a header with some of {', '.join(pose_csv.COLUMNS)}"
)


def parse_trajectory(
    path: Path, format_name: str | None = None, axes: Axes | None = None
) -> ParsedTrajectory:
    """Read the poses of a file, and its times if it has them.

    Args:
        path: trajectory file.
        format_name: one of `FORMATS`, or None to detect it from the file's suffix and columns.
        axes: axes of the poses in the file; None: KITTI's for a KITTI file, the world's otherwise.

    Raises:
        TrajectoryError: the file is invalid; names file, line, actual and expected value.
    """
    table = read_text_table(path)
    name = _known(format_name) if format_name else _format_of(path, table)
    axes = _known_axes(axes, name)
    parsed = dataclasses.replace(FORMATS[name].read(table), format=name)
    if axes == "world":
        return parsed
    poses = _change_axes(parsed.world_from_base, _FROM_KITTI)
    return dataclasses.replace(parsed, world_from_base=poses, axes=axes)


def read_trajectory(
    path: Path,
    rate_hz: float | None = None,
    max_step_m: float = math.inf,
    max_speed_mps: float | None = None,
    format_name: str | None = None,
    axes: Axes | None = None,
) -> Trajectory:
    """Read a trajectory file.

    Args:
        path: trajectory file.
        rate_hz: poses per second, for a file without times.
        max_step_m, max_speed_mps: limits between successive poses; a larger step is a jump.
        format_name: one of `FORMATS`, or None to detect it from the file's suffix and columns.
        axes: axes of the poses in the file; None: the format's convention.

    Raises:
        TrajectoryError: the file is invalid; names file, line, actual and expected value.
    """
    recording = parse_trajectory(path, format_name, axes)
    trajectory = recording.trajectory(rate_hz)
    check_continuous(
        trajectory, max_step_m, recording.source, max_speed_mps, recording.line_numbers
    )
    return trajectory


def write_trajectory(
    path: Path, trajectory: Trajectory, format_name: str | None = None, axes: Axes | None = None
) -> None:
    """Write a trajectory file atomically.

    Args:
        path: output file.
        trajectory: trajectory to write.
        format_name: one of `FORMATS`; None: by the suffix .tum, .kitti, or .csv for omnisim's own.
        axes: axes of the poses in the file; None: the format's convention, as in reading.

    Raises:
        TrajectoryError: the format is unknown, or the suffix names none.
        OutputError: the file cannot be written.
    """
    name = format_name or path.suffix.lower().removeprefix(".")
    if not format_name and (name not in FORMATS or name == "euroc"):
        raise TrajectoryError(
            f"{path}: suffix {path.suffix!r} names no format: expected .tum, .kitti or .csv, "
            f"or a format: {', '.join(FORMATS)}"
        )
    if _known_axes(axes, _known(name)) == "kitti":
        poses = _change_axes(trajectory.world_from_base, inverse(_FROM_KITTI))
        trajectory = Trajectory(trajectory.times_s, poses)
    write_lines(path, FORMATS[name].lines(trajectory))


def write_lines(path: Path, lines: Iterable[str]) -> None:
    """Write lines to a text file atomically.

    Raises:
        OutputError: the file cannot be written.
    """
    check_target(path)
    write_text(path, "".join(f"{line}\n" for line in lines))


def _known(name: str) -> str:
    if name not in FORMATS:
        raise TrajectoryError(f"format {quote(name)!r}: expected one of {', '.join(FORMATS)}")
    return name


def _known_axes(axes: Axes | None, format_name: str) -> Axes:
    """Axes of a file: the given axes, or those of the format's convention."""
    if axes is None:
        return "kitti" if format_name == "kitti" else "world"
    if axes not in get_args(Axes):
        raise TrajectoryError(f"axes {axes!r}: expected one of {', '.join(get_args(Axes))}")
    if format_name == "csv" and axes != "world":
        raise TrajectoryError(f"axes {axes!r}: expected world: headings of a CSV are on the ground")
    return axes


def _change_axes(poses: Floats, new_from_old: Floats) -> Floats:
    """Change the axes of poses (n, 4, 4) and of their frame, without rounding errors."""
    return new_from_old @ poses @ inverse(new_from_old)


def _format_of(path: Path, table: TextTable) -> str:
    suffix = path.suffix.lower()
    if suffix in (".tum", ".kitti"):
        return suffix[1:]
    cells = table.lines[0].cells
    # a number, or the name of an image before the numbers of a TUM file
    is_named = len(cells) == len(tum.COLUMNS) and is_file_name(cells[0]) and is_number(cells[1])
    starts_a_pose = is_named or is_number(cells[0])
    if table.separator is None and suffix != ".csv" and starts_a_pose:
        by_width = {len(tum.COLUMNS): "tum", len(kitti.COLUMNS): "kitti"}
        if len(cells) in by_width:
            return by_width[len(cells)]
    elif not set(cells).isdisjoint(pose_csv.COLUMNS):
        return "csv"
    elif len(cells) == len(euroc.COLUMNS):
        return "euroc"
    kind = "comma-separated" if table.separator else "space-separated"
    columns = f"{len(cells)} {kind} column{'s' if len(cells) > 1 else ''}"
    raise table.fault(table.lines[0], f"{columns}, first {quote(cells[0])!r}: {WANTED}")
