"""Trajectories from files and into files: TUM, KITTI, EuRoC, and our own CSV (`formats/`)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Protocol

from omnisim.atomic_file import check_target, write_text
from omnisim.errors import TrajectoryError
from omnisim.robot.formats import euroc, kitti, pose_csv, tum
from omnisim.robot.formats.parsed_trajectory import ParsedTrajectory
from omnisim.robot.formats.text_table import TextTable, is_number, quote, read_text_table
from omnisim.robot.trajectory import Trajectory, check_continuous


class TrajectoryFormat(Protocol):
    """Module of a format."""

    def read(self, table: TextTable) -> ParsedTrajectory:
        """Read a table."""

    def lines(self, trajectory: Trajectory) -> Iterator[str]:
        """Lines of a file."""


FORMATS: dict[str, TrajectoryFormat] = {"tum": tum, "kitti": kitti, "euroc": euroc, "csv": pose_csv}
WANTED = (
    f"expected 8 columns between blanks (TUM), 12 (KITTI), 17 between commas (EuRoC), "
    f"or a header with some of {', '.join(pose_csv.COLUMNS)}"
)


def parse_trajectory(path: Path, format_name: str | None = None) -> ParsedTrajectory:
    """Read the poses of a file, and its times where it has any.

    Args:
        path: the file.
        format_name: one of `FORMATS`, or None: by the file's suffix and columns.

    Raises:
        TrajectoryError: naming file, line, what was found and expected.
    """
    table = read_text_table(path)
    name = _known(format_name) if format_name else _format_of(path, table)
    return FORMATS[name].read(table)


def read_trajectory(
    path: Path,
    rate_hz: float | None = None,
    max_step_m: float = math.inf,
    max_speed_mps: float | None = None,
    format_name: str | None = None,
) -> Trajectory:
    """Read a trajectory.

    Args:
        path: the file.
        rate_hz: poses a second, for a file without times.
        max_step_m, max_speed_mps: what is farther or faster from one pose to the next is a jump.
        format_name: one of `FORMATS`, or None: by the file's suffix and columns.

    Raises:
        TrajectoryError: naming file, line, what was found and expected.
    """
    recording = parse_trajectory(path, format_name)
    trajectory = recording.trajectory(rate_hz)
    check_continuous(
        trajectory, max_step_m, recording.source, max_speed_mps, recording.line_numbers
    )
    return trajectory


def write_trajectory(path: Path, trajectory: Trajectory, format_name: str | None = None) -> None:
    """Write a trajectory: all of it, or nothing.

    Args:
        path: the file.
        trajectory: what is written.
        format_name: one of `FORMATS`, or None: by the suffix, .tum, .kitti, or .csv for our own.

    Raises:
        TrajectoryError: no such format, or a suffix that names none.
        OutputError: the file cannot be written.
    """
    name = format_name or path.suffix.lower().removeprefix(".")
    if not format_name and (name not in FORMATS or name == "euroc"):
        raise TrajectoryError(
            f"{path}: suffix {path.suffix!r} names no format: expected .tum, .kitti or .csv, "
            f"or a format: {', '.join(FORMATS)}"
        )
    write_lines(path, FORMATS[_known(name)].lines(trajectory))


def write_lines(path: Path, lines: Iterable[str]) -> None:
    """Write a text file of lines: all of it, or nothing.

    Raises:
        OutputError: the file cannot be written.
    """
    check_target(path)
    write_text(path, "".join(f"{line}\n" for line in lines))


def _known(name: str) -> str:
    if name not in FORMATS:
        raise TrajectoryError(f"format {quote(name)!r}: expected one of {', '.join(FORMATS)}")
    return name


def _format_of(path: Path, table: TextTable) -> str:
    suffix = path.suffix.lower()
    if suffix in (".tum", ".kitti"):
        return suffix[1:]
    cells = table.lines[0].cells
    if table.separator is None and is_number(cells[0]) and suffix != ".csv":
        by_width = {len(tum.COLUMNS): "tum", len(kitti.COLUMNS): "kitti"}
        if len(cells) in by_width:
            return by_width[len(cells)]
    elif not set(cells).isdisjoint(pose_csv.COLUMNS):
        return "csv"
    elif len(cells) == len(euroc.COLUMNS):
        return "euroc"
    between = "commas" if table.separator else "blanks"
    raise table.fault(
        table.lines[0],
        f"{len(cells)} column{'s' if len(cells) > 1 else ''} between {between}, "
        f"first {quote(cells[0])!r}: {WANTED}",
    )
