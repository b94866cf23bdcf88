"""Calibration boards, and the corners that images show of them."""

from __future__ import annotations

import math
import re
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from omnisim.cameras.calibration.documents import parse_yaml, read_text
from omnisim.core.arrays import Floats
from omnisim.core.errors import CalibrationError, MeasurementError, NoticeWarning

_UNITS_M = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
_LENGTH = re.compile(r"(\d+(?:\.\d+)?)\s*(mm|cm|m)?")
MAX_USUAL_M = 5.0  # width of a board above which a notice asks about the unit
_GRID = re.compile(r"(\d+)x(\d+)")
_FORMS = "8x6:30mm, charuco:9x7:30mm:22mm:5X5_100, aprilgrid:6x6:88mm:0.3 or a Kalibr file (.yaml)"
DICTIONARIES = ("4X4", "5X5", "6X6", "7X7")


@dataclass(frozen=True)
class Chessboard:
    """Chessboard of squares with sides `square_m`.

    Raises:
        MeasurementError: fewer than 3 corners in a direction, or a side that is not positive.
    """

    columns: int  # inner corners along a row
    rows: int  # inner corners along a column
    square_m: float

    def __post_init__(self) -> None:
        _check(self.columns, self.rows, 3, square=self.square_m)


@dataclass(frozen=True)
class CharucoBoard:
    """Chessboard with ArUco markers in its white squares.

    Raises:
        MeasurementError: fewer than 3 squares in a direction, sides that are not positive, a marker
            as large as its square, or an unknown dictionary.
    """

    columns: int  # squares along a row
    rows: int  # squares along a column
    square_m: float  # side of a square
    marker_m: float  # side of a marker
    dictionary: str  # OpenCV's dictionary without its prefix, such as "5X5_100"

    def __post_init__(self) -> None:
        _check(self.columns, self.rows, 3, square=self.square_m, marker=self.marker_m)
        if self.marker_m >= self.square_m:
            raise MeasurementError(
                f"board: marker: expected less than the square's {self.square_m:g} m, "
                f"got {self.marker_m:g}"
            )
        if not re.fullmatch(rf"({'|'.join(DICTIONARIES)})_(50|100|250|1000)", self.dictionary):
            raise MeasurementError(
                f"board: dictionary: expected one such as 5X5_100, got {self.dictionary!r}"
            )


@dataclass(frozen=True)
class AprilGrid:
    """Kalibr's grid of AprilTags (36h11) with ids along its rows, from the lower left.

    Raises:
        MeasurementError: no tags, or lengths that are not positive.
    """

    # columns, rows: tags along a row and along a column
    columns: int
    rows: int
    tag_m: float  # side of a tag's black square
    spacing: float  # gap between tags divided by `tag_m`

    def __post_init__(self) -> None:
        _check(self.columns, self.rows, 1, tag=self.tag_m, spacing=self.spacing)


Board = Chessboard | CharucoBoard | AprilGrid


def read_board(text: str) -> Board:
    """Board from its description.

    Args:
        text: `COLUMNSxROWS:SQUARE` for a chessboard, counting inner corners, such as `8x6:30mm`;
            `charuco:COLUMNSxROWS:SQUARE:MARKER:DICTIONARY`, counting squares;
            `aprilgrid:COLUMNSxROWS:TAG:SPACING`, counting tags; or the path of a Kalibr target
            file.

    Raises:
        MeasurementError: an invalid description or file; the message names the wrong part.
    """
    if text.endswith((".yaml", ".yml")):
        return _kalibr_board(Path(text))
    kind, *parts = text.split(":") if text[:1].isalpha() else ("chessboard", *text.split(":"))
    counts = {"chessboard": 2, "charuco": 4, "aprilgrid": 3}
    if len(parts) != counts.get(kind):
        raise MeasurementError(f"board: expected {_FORMS}, got {text!r}")
    grid = _GRID.fullmatch(parts[0])
    if grid is None:
        raise MeasurementError(f"board: expected columns and rows such as 8x6, got {parts[0]!r}")
    columns, rows = int(grid[1]), int(grid[2])
    size_m = _length_m(parts[1])
    width_m, has_unit = max(columns, rows) * size_m, not parts[1][-1:].isdigit()
    if width_m > MAX_USUAL_M and not has_unit:
        note = f"board {text}: {width_m:g} m wide; {parts[1]}mm would be millimeters"
        warnings.warn(note, NoticeWarning, stacklevel=2)
    if kind == "chessboard":
        return Chessboard(columns, rows, size_m)
    if kind == "charuco":
        return CharucoBoard(columns, rows, size_m, _length_m(parts[2]), parts[3])
    try:
        return AprilGrid(columns, rows, size_m, float(parts[2]))
    except ValueError:
        message = f"board: spacing: expected a number such as 0.3, got {parts[2]!r}"
        raise MeasurementError(message) from None


def _kalibr_board(path: Path) -> Board:
    """Board of a Kalibr target file. Source: Kalibr's wiki, "Calibration targets"."""
    try:
        table = parse_yaml(read_text(path), str(path))
    except CalibrationError as reason:
        raise MeasurementError(str(reason)) from None
    kind = table.get("target_type")
    try:
        if kind == "checkerboard":
            along_row, along_column = (
                _number(path, table, f"{name}SpacingMeters") for name in ("col", "row")
            )
            if not math.isclose(along_row, along_column, rel_tol=1e-9):
                raise MeasurementError("expected square fields: rowSpacingMeters is another length")
            columns, rows = (_count(path, table, f"target{name}") for name in ("Cols", "Rows"))
            return Chessboard(columns, rows, along_row)
        if kind == "aprilgrid":
            columns, rows = (_count(path, table, f"tag{name}") for name in ("Cols", "Rows"))
            tag_m, spacing = (_number(path, table, f"tag{name}") for name in ("Size", "Spacing"))
            return AprilGrid(columns, rows, tag_m, spacing)
    except MeasurementError as reason:
        raise MeasurementError(f"{path}: {str(reason).removeprefix(f'{path}: ')}") from None
    raise MeasurementError(f"{path}: target_type: expected checkerboard or aprilgrid, got {kind!r}")


def _number(path: Path, table: dict[str, Any], key: str) -> float:
    value = table.get(key)
    if not isinstance(value, int | float) or isinstance(value, bool):
        raise MeasurementError(f"{path}: {key}: expected a number, got {value!r:.60}")
    return float(value)


def _count(path: Path, table: dict[str, Any], key: str) -> int:
    value = _number(path, table, key)
    if value != int(value):
        raise MeasurementError(f"{path}: {key}: expected a whole number, got {value:g}")
    return int(value)


def _length_m(text: str) -> float:
    match = _LENGTH.fullmatch(text.strip())
    if match is None:
        raise MeasurementError(f"board: expected a length such as 30mm, got {text!r}")
    return float(match[1]) * _UNITS_M[match[2] or "m"]


def _check(columns: int, rows: int, least: int, **sizes: float) -> None:
    if min(columns, rows) < least or max(columns, rows) > 100:
        got = f"{columns} x {rows}"
        raise MeasurementError(f"board: expected {least} to 100 columns and rows, got {got}")
    for name, size in sizes.items():
        if not 0.0 < size < 100.0:  # also rejects NaN
            raise MeasurementError(f"board: {name}: expected more than 0, got {size:g}")


@dataclass(frozen=True, eq=False)
class BoardView:
    """Corners of a board in one image."""

    name: str  # image file, or another name of the image
    # (n, 2) positions on the flat board: x along the rows, y along the columns
    points_m: Floats
    pixels_px: Floats  # (n, 2) positions in the image

    @property
    def points_3d_m(self) -> Floats:
        """Corners (n, 3) in the board's frame, z = 0."""
        return np.column_stack((self.points_m, np.zeros(len(self.points_m))))


@dataclass(frozen=True)
class RejectedImage:
    """Image without a usable board, and the reason."""

    name: str
    reason: str
