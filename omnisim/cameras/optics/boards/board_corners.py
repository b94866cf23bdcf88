"""Corners of flat calibration boards in images, and their files.

A CSV file has the columns image, x_m, y_m, u_px, v_px: the image number, the corner's position on
the board, and its position in the image.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from omnisim.cameras.optics.shapes.shape import Floats
from omnisim.core.errors import OpticsError, TrajectoryError
from omnisim.core.files.atomic_file import write_text
from omnisim.core.trajectories.formats.text_table import read_text_table

COLUMNS = ("image", "x_m", "y_m", "u_px", "v_px")
MIN_CORNERS = 6  # per board, to determine its pose


@dataclass(frozen=True, eq=False)
class BoardCorners:
    """Board corners in one image.

    Raises:
        OpticsError: there are too few corners, or the shapes are wrong.
    """

    points_m: Floats  # (n, 2) positions on the flat board
    pixels_px: Floats  # (n, 2) positions in the image

    def __post_init__(self) -> None:
        shapes = np.shape(self.points_m), np.shape(self.pixels_px)
        if shapes[0] != shapes[1] or shapes[0][1:] != (2,):
            raise OpticsError(f"corners: expected points and pixels (n, 2), got {shapes}")
        if len(self.points_m) < MIN_CORNERS:
            expected = f"expected at least {MIN_CORNERS} corners of a board"
            raise OpticsError(f"corners: {expected}, got {len(self.points_m)}")

    @property
    def points_3d_m(self) -> Floats:
        """Corners (n, 3) in the board's frame, z = 0."""
        return np.column_stack((self.points_m, np.zeros(len(self.points_m))))


def read_corners(path: Path) -> list[BoardCorners]:
    """Read the corners of each image from a file.

    Raises:
        OpticsError: the file is invalid; names file, line, actual and expected value.
    """
    try:
        table = read_text_table(path)
        names = table.lines[0].cells
        if sorted(names) != sorted(COLUMNS):
            message = f"expected the columns {','.join(COLUMNS)}, got {','.join(names)}"
            raise OpticsError(f"{path}: {message}")
        numbers = table.without_header().numbers(names)
    except TrajectoryError as reason:
        raise OpticsError(str(reason)) from None
    columns = numbers[:, [names.index(name) for name in COLUMNS]]
    boards = []
    for image in np.unique(columns[:, 0]):
        rows = columns[columns[:, 0] == image]
        try:
            boards.append(BoardCorners(rows[:, 1:3], rows[:, 3:5]))
        except OpticsError as reason:
            raise OpticsError(f"{path}: image {image:g}: {reason}") from None
    return boards


def write_corners(path: Path, boards: Sequence[BoardCorners]) -> None:
    """Write corners to a CSV file.

    Raises:
        OutputError: the file cannot be written.
    """
    lines = [",".join(COLUMNS)]
    for number, board in enumerate(boards):
        rows = np.column_stack((board.points_m, board.pixels_px)).tolist()
        lines += [f"{number},{','.join(map(repr, row))}" for row in rows]
    write_text(path, "\n".join(lines) + "\n")
