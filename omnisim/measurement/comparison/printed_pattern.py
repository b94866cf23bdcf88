"""Printed patterns of calibration boards: cells of ink and paper, even patches, and edges.

Sources: OpenCV's module `aruco`, for the bits of markers; Kalibr's wiki, "Calibration targets".
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnisim.measurement.geometry.board_markers import TAG_BORDER_BITS, charuco_markers, tag_cells
from omnisim.measurement.geometry.boards import AprilGrid, Board, CharucoBoard, Chessboard

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
_PAPER = 1  # squares of white paper around the squares of a board


@dataclass(frozen=True, eq=False)
class Patches:
    """Rectangles of one color, large enough for a comparison of their gray levels.

    Attributes:
        rectangles_m: (patches, 4) left, top, right and bottom on the board.
        between_m: (patches, 4) rectangle of four corners of the board that contains each patch.
        is_black: (patches,) True for ink.
    """

    rectangles_m: Floats
    between_m: Floats
    is_black: Bools

    @property
    def centers_m(self) -> Floats:
        """Centers (patches, 2) on the board."""
        return 0.5 * (self.rectangles_m[:, :2] + self.rectangles_m[:, 2:])

    def select(self, chosen: Bools) -> Patches:
        """Patches selected by a mask (patches,)."""
        return Patches(self.rectangles_m[chosen], self.between_m[chosen], self.is_black[chosen])


@dataclass(frozen=True, eq=False)
class PrintedPattern:
    """Print of a board in its own plane, x along the rows and y along the columns.

    Attributes:
        x_m: (columns + 1,) positions of the vertical lines between cells, ascending.
        y_m: (rows + 1,) positions of the horizontal lines, ascending.
        is_black: (rows, columns) True for cells of ink.
        patches: patches whose gray levels are compared.
        edges_m: (edges, 2, 2) both ends of edges between ink and paper, at corners of the board.
        clear: distance from an edge, as a share of its length, up to which each side is of one
            color.
    """

    x_m: Floats
    y_m: Floats
    is_black: Bools
    patches: Patches
    edges_m: Floats
    clear: float

    @property
    def cell_centers_m(self) -> Floats:
        """Centers (rows, columns, 2) of the cells."""
        x, y = (0.5 * (lines[1:] + lines[:-1]) for lines in (self.x_m, self.y_m))
        return np.stack(np.meshgrid(x, y), axis=-1)


def possible_patterns(board: Board) -> list[PrintedPattern]:
    """Patterns that a board's description permits; an image tells which one was printed.

    The first square of a chessboard is black or white, and the tags of an AprilGrid have any of
    four rotations.
    """
    if isinstance(board, Chessboard):
        return [_chessboard(board, first) for first in (0, 1)]
    if isinstance(board, CharucoBoard):
        return [_charuco(board)]
    return [_april_grid(board, turns) for turns in range(4)]


def _chessboard(board: Chessboard, first: int) -> PrintedPattern:
    """Chessboard whose squares with an even sum of indices are black if `first` is 0."""
    columns, rows, side = board.columns, board.rows, board.square_m
    x, y = (side * np.arange(-1.0 - _PAPER, count + 1.0 + _PAPER) for count in (columns, rows))
    is_black = _checkers(rows + 1, columns + 1, first)
    inner = _rectangles(x[2:-2], y[2:-2])
    patches = Patches(inner, inner, is_black[1:-1, 1:-1].ravel())
    return PrintedPattern(
        x, y, np.pad(is_black, _PAPER), patches, _grid_edges(x[2:-2], y[2:-2]), 0.4
    )


def _charuco(board: CharucoBoard) -> PrintedPattern:
    """ChArUco board: markers in the white squares of a chessboard."""
    side, margin = board.square_m, 0.5 * (board.square_m - board.marker_m)
    markers = charuco_markers(board)
    bits = len(next(iter(markers.values())))
    lines = np.concatenate(([0.0], np.linspace(margin, side - margin, bits + 1)))
    x, y = (
        np.concatenate(
            (
                [-side],
                *(side * index + lines for index in range(count)),
                side * (count + np.arange(2.0)),
            )
        )
        for count in (board.columns, board.rows)
    )
    squares = _checkers(board.rows, board.columns, 0)
    cells = np.kron(squares, np.ones((bits + 2, bits + 2), dtype=bool))
    for (row, column), marker in markers.items():
        top, left = row * (bits + 2) + 1, column * (bits + 2) + 1
        cells[top : top + bits, left : left + bits] = marker
    inner_x, inner_y = (side * np.arange(1.0, count) for count in (board.columns, board.rows))
    between, is_ink = _rectangles(inner_x, inner_y), squares[1:-1, 1:-1].ravel()
    paper = between[~is_ink]
    patches = _patches(
        (between[is_ink], between[is_ink], True),
        (_strips(paper, margin), np.repeat(paper, 4, axis=0), False),
    )
    return PrintedPattern(
        x, y, np.pad(cells, 1), patches, _grid_edges(inner_x, inner_y), margin / side
    )


def _april_grid(board: AprilGrid, quarter_turns: int) -> PrintedPattern:
    """AprilGrid: tags, and squares of ink between the corners of neighboring tags."""
    tag, gap = board.tag_m, board.tag_m * board.spacing
    pitch = tag + gap
    codes = [
        np.rot90(tag_cells(number), quarter_turns) for number in range(board.columns * board.rows)
    ]
    bits = len(codes[0])
    lines = np.linspace(0.0, tag, bits + 1)
    starts_x = pitch * np.arange(board.columns)
    starts_y = -tag - pitch * np.arange(board.rows)[::-1]  # y is down, rows count upward
    x, y = (
        np.concatenate(
            (
                starts[0] - gap * np.array([2.0, 1.0]),
                *(start + lines for start in starts),
                starts[-1] + tag + gap * np.array([1.0, 2.0]),
            )
        )
        for starts in (starts_x, starts_y)
    )
    cells = np.zeros((len(y) - 1, len(x) - 1), dtype=bool)
    cells[1 :: bits + 1, 1 :: bits + 1] = True
    for number, code in enumerate(codes):
        row, column = board.rows - 1 - number // board.columns, number % board.columns
        top, left = row * (bits + 1) + 2, column * (bits + 1) + 2
        cells[top : top + bits, left : left + bits] = code
    edges_x, edges_y = (
        np.stack((starts, starts + tag), axis=1).ravel() for starts in (starts_x, starts_y)
    )
    rectangles = _rectangles(edges_x, edges_y).reshape(len(edges_y) - 1, len(edges_x) - 1, 4)
    tags = rectangles[::2, ::2].reshape(-1, 4)
    crossings = rectangles[1::2, 1::2].reshape(-1, 4)
    gaps = np.concatenate(
        (rectangles[::2, 1::2].reshape(-1, 4), rectangles[1::2, ::2].reshape(-1, 4))
    )
    border = tag * TAG_BORDER_BITS / bits
    patches = _patches(
        (_strips(tags, border), np.repeat(tags, 4, axis=0), True),
        (crossings, crossings, True),
        (gaps, gaps, False),
    )
    clear = min(border / tag, board.spacing)
    return PrintedPattern(x, y, cells, patches, _sides(tags), clear)


def _checkers(rows: int, columns: int, first: int) -> Bools:
    """Squares (rows, columns) of a chessboard; the one at the origin is black if `first` is 0."""
    is_black: Bools = np.indices((rows, columns)).sum(axis=0) % 2 == first
    return is_black


def _rectangles(x: Floats, y: Floats) -> Floats:
    """Rectangles (n, 4) between neighboring lines, row by row: left, top, right, bottom."""
    left, top = np.meshgrid(x[:-1], y[:-1])
    right, bottom = np.meshgrid(x[1:], y[1:])
    return np.stack((left, top, right, bottom), axis=-1).reshape(-1, 4)


def _strips(rectangles: Floats, width: float) -> Floats:
    """Strips (4 n, 4) along the inner sides of rectangles (n, 4)."""
    strips = np.repeat(rectangles[:, None], 4, axis=1)
    for side, sign in enumerate((1.0, 1.0, -1.0, -1.0)):
        strips[:, side, (side + 2) % 4] = rectangles[:, side] + sign * width
    return strips.reshape(-1, 4)


def _sides(rectangles: Floats) -> Floats:
    """Sides (4 n, 2, 2) of rectangles (n, 4), by their ends."""
    left, top, right, bottom = rectangles.T
    corners = ((left, top), (right, top), (right, bottom), (left, bottom), (left, top))
    points = np.stack([np.stack(corner, axis=-1) for corner in corners], axis=1)
    return np.stack((points[:, :-1], points[:, 1:]), axis=2).reshape(-1, 2, 2)


def _grid_edges(x: Floats, y: Floats) -> Floats:
    """Edges (n, 2, 2) between neighboring points of a grid, by their ends."""
    grid = np.stack(np.meshgrid(x, y), axis=-1)
    along_rows = np.stack((grid[:, :-1], grid[:, 1:]), axis=2).reshape(-1, 2, 2)
    along_columns = np.stack((grid[:-1], grid[1:]), axis=2).reshape(-1, 2, 2)
    return np.concatenate((along_rows, along_columns))


def _patches(*parts: tuple[Floats, Floats, bool]) -> Patches:
    """Patches from parts of rectangles (n, 4), their surrounding corners (n, 4), and a color."""
    rectangles, between, colors = zip(*parts, strict=True)
    return Patches(
        np.concatenate(rectangles),
        np.concatenate(between),
        np.repeat(colors, [len(part) for part in rectangles]),
    )
