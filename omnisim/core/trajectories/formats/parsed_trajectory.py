"""Tables of numbers in text files, and the trajectories that format modules parse from them.

Errors name file, line, the actual and the expected value.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from omnisim.core.arrays import Bools, Floats, Indices
from omnisim.core.errors import OmnisimError, TrajectoryError
from omnisim.core.poses import (
    MAX_M,
    is_rotation,
    nearest_rotation,
    pose_from_rotation,
    rotation_from_quaternion,
)
from omnisim.core.trajectories.trajectory import MAX_S, Trajectory

NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
NOT_FINITE = re.compile(r"[+-]?(nan|inf|infinity)", re.IGNORECASE)
MAX_NUMBER = 1e20  # above any timestamp in nanoseconds; squares do not overflow
MAX_QUOTE = 40  # characters
_FILE_NAME = re.compile(r".+\.[A-Za-z]\w*")


@dataclass(frozen=True)
class Line:
    """Line of a file: its number, counted from 1, and its cells."""

    number: int
    cells: list[str]


@dataclass(frozen=True)
class TextTable:
    """Lines of a file, without empty lines and comments."""

    source: str  # file name, for messages
    lines: list[Line]  # lines with their cells; at least one
    separator: str | None  # "," or None for blanks

    def fault(self, line: Line, message: str) -> TrajectoryError:
        """Error at a line of this file."""
        return TrajectoryError(f"{self.source}:{line.number}: {message}")

    def without_header(self) -> TextTable:
        """Table without its first line."""
        if len(self.lines) == 1:
            raise TrajectoryError(
                f"{self.source}: only a header: expected at least one line of numbers"
            )
        return replace(self, lines=self.lines[1:])

    def without_column(self, index: int) -> tuple[TextTable, tuple[str, ...]]:
        """Table without a column, and its cells; lines that lack it are left as they are."""
        cells = tuple(line.cells[index] if index < len(line.cells) else "" for line in self.lines)
        lines = [
            Line(line.number, line.cells[:index] + line.cells[index + 1 :]) for line in self.lines
        ]
        return replace(self, lines=lines), cells

    def numbers(self, names: list[str]) -> Floats:
        """All cells (lines, columns) as finite numbers; each line has one cell per column name."""
        rows = []
        for line in self.lines:
            if (count := len(line.cells)) != len(names):
                columns = f"{count} column{'s' if count > 1 else ''}"
                raise self.fault(line, f"{columns}: expected {len(names)}: {' '.join(names)}")
            named = zip(names, line.cells, strict=True)
            rows.append([self._number(line, name, cell) for name, cell in named])
        return np.array(rows, dtype=np.float64)

    def _number(self, line: Line, name: str, cell: str) -> float:
        if NUMBER.fullmatch(cell):
            value = float(cell)
            if abs(value) < MAX_NUMBER:
                return value
            raise self.fault(line, f"{name} = {quote(cell)}: expected less than {MAX_NUMBER:g}")
        if NOT_FINITE.fullmatch(cell):
            raise self.fault(line, f"{name} = {cell}: expected a finite number")
        raise self.fault(line, f"{name} = {quote(cell)!r}: expected a number")

    def check_times(self, times_s: Floats, printed: list[str]) -> None:
        """Reject times (lines,) that do not increase; `printed` holds their text in the file."""
        later = np.diff(times_s) > 0.0
        if not np.all(later):
            k = int(np.argmin(later))
            relation = "repeats" if times_s[k + 1] == times_s[k] else "is before"
            raise self.fault(
                self.lines[k + 1],
                f"time {printed[k + 1]} {relation} {printed[k]} of line {self.lines[k].number}: "
                "expected times that increase",
            )


def read_text_table(path: Path) -> TextTable:
    """Read a text file with cells separated by commas or blanks; `#` starts a comment line."""
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except OSError as reason:
        raise TrajectoryError(f"{path}: cannot be read: {reason.strerror}") from None
    except UnicodeDecodeError:
        text = "\0"
    if "\0" in text:
        raise TrajectoryError(f"{path}: not a text file: expected lines of numbers")
    numbered = [(k, line.strip()) for k, line in enumerate(text.split("\n"), start=1)]
    kept = [(k, line) for k, line in numbered if line and not line.startswith("#")]
    if not kept:
        raise TrajectoryError(f"{path}: empty: expected at least one line of numbers")
    separator = "," if "," in kept[0][1] else None
    lines = [Line(k, [cell.strip() for cell in line.split(separator)]) for k, line in kept]
    return TextTable(str(path), lines, separator)


def read_columns(path: Path, columns: Sequence[str], error: type[OmnisimError]) -> Floats:
    """Read the numbers (lines, columns) of a file whose header names the columns, in any order.

    Raises:
        error: the file is invalid; names file, line, actual and expected value.
    """
    try:
        table = read_text_table(path)
        names = table.lines[0].cells
        if sorted(names) != sorted(columns):
            raise error(f"{path}: expected the columns {','.join(columns)}, got {','.join(names)}")
        numbers = table.without_header().numbers(names)
    except TrajectoryError as reason:
        raise error(str(reason)) from None
    return numbers[:, [names.index(name) for name in columns]]


def is_number(cell: str) -> bool:
    """True if a cell is a number, finite or not."""
    return bool(NUMBER.fullmatch(cell) or NOT_FINITE.fullmatch(cell))


def is_file_name(cell: str) -> bool:
    """True if a cell is the name of a file with a suffix, such as 0001.png."""
    return bool(_FILE_NAME.fullmatch(cell)) and not is_number(cell)


def quote(text: str) -> str:
    """Quote text for a one-line message."""
    return text if len(text) <= MAX_QUOTE else text[:MAX_QUOTE] + "…"


def check_printed_times(times_s: Floats) -> None:
    """Reject times (n,) that become equal when printed to the nanosecond."""
    same = np.diff(np.rint(times_s * 1e9)) <= 0.0
    if np.any(same):
        k = int(np.argmax(same))
        raise TrajectoryError(
            f"trajectory: times {k} and {k + 1} are less than a nanosecond apart: "
            "a file cannot tell them apart"
        )


# Poses parsed from a trajectory file, and checks of its times and rotations for format modules.

# A quaternion or matrix printed with a few digits, or rounded to float32, is well within this.
ROUNDING = 1e-3
# "world": x forward, y left, z up (REP 103); "kitti": x right, y down, z forward, for the pose at
# the origin and for all others (KITTI odometry benchmark, development kit).
Axes = Literal["world", "kitti"]


@dataclass(frozen=True, eq=False)
class ParsedTrajectory:
    """Poses in a file, with or without times."""

    source: str  # file name, for messages
    line_numbers: Indices  # (n,) line of each pose in the file, counted from 1
    times_s: Floats | None  # (n,) times, or None if the file has none
    world_from_base: Floats  # (n, 4, 4) poses in world axes
    axes: Axes = "world"  # axes of the poses in the file
    has_heights: bool = True  # False for poses on a floor plan: x, y and heading
    format: str = ""  # name of the file format
    # (n,) image file of each pose, or None if the file has no names
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
    table: TextTable, times_s: Floats | None, positions_m: Floats, rotations: Floats
) -> ParsedTrajectory:
    """Assemble poses that a format module has read from a table, one per line.

    They are times (n,) or None, positions (n, 3) and rotations (n, 3, 3).
    """
    _check_lines(
        table,
        np.all(np.abs(positions_m) < MAX_M, axis=1),
        lambda k: f"position {positions_m[k].tolist()}: expected less than {MAX_M:g} m",
    )
    poses = pose_from_rotation(rotations, positions_m)
    return ParsedTrajectory(
        table.source, np.array([line.number for line in table.lines]), times_s, poses
    )


def checked_times(table: TextTable, times_s: Floats) -> Floats:
    """Validated times (n,) from a table's first column."""
    for line, time in zip(table.lines, times_s, strict=True):
        if abs(time) >= MAX_S:
            raise table.fault(line, f"time {time:g} s: expected less than {MAX_S:g} s")
    table.check_times(times_s, [f"{time:.9g} s" for time in times_s])
    return times_s


def rotations_from_quaternions(table: TextTable, xyzw: Floats) -> Floats:
    """Rotations (n, 3, 3) from a table's quaternions (n, 4)."""
    lengths = np.linalg.norm(xyzw, axis=-1)
    _check_lines(
        table,
        np.abs(lengths - 1.0) <= ROUNDING,
        lambda k: f"quaternion of length {lengths[k]:.6g}: expected 1 (within {ROUNDING:g})",
    )
    return rotation_from_quaternion(xyzw)


def rotations_from_matrices(table: TextTable, matrices: Floats) -> Floats:
    """Rotations (n, 3, 3) from a table's matrices, with rounding errors removed."""
    _check_lines(
        table,
        is_rotation(matrices, ROUNDING),
        lambda k: (
            f"the matrix scales, shears or mirrors: expected a rotation (within {ROUNDING:g})"
        ),
    )
    return nearest_rotation(matrices)


def _check_lines(table: TextTable, is_valid: Bools, message: Callable[[int], str]) -> None:
    if not np.all(is_valid):
        k = int(np.argmin(is_valid))
        raise table.fault(table.lines[k], message(k))
