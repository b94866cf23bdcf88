"""Squares of a world grid on a torus: cell p is kept at p modulo the side of the square.

While a square moves over the grid, only the cells that enter it are new. They take the places of
those that leave it. Periods are repetitions of the torus over the grid.
Source: Losasso and Hoppe, "Geometry Clipmaps", SIGGRAPH 2004, toroidal access.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple


class Cells(NamedTuple):
    """Rectangle of grid cells.

    Attributes:
        left, top: first cell.
        width, height: number of cells.
    """

    left: int
    top: int
    width: int
    height: int


class TorusPart(NamedTuple):
    """Rectangle within one period of the torus.

    Attributes:
        period: column and row of the period.
        place: cells on the torus.
        cells: the same cells on the grid.
    """

    period: tuple[int, int]
    place: Cells
    cells: Cells


def entered_cells(old: tuple[int, int] | None, new: tuple[int, int], side: int) -> list[Cells]:
    """Cells of a square that were not in its old place, as at most two rectangles.

    Args:
        old: first cell of the square's old place; None: it had none.
        new: first cell of its new place.
        side: cells per side.
    """
    left, top = new
    shift_x, shift_y = (0, side) if old is None else (left - old[0], top - old[1])
    if max(abs(shift_x), abs(shift_y)) >= side:
        return [Cells(left, top, side, side)]
    # the new columns, then the new rows of the other columns
    columns, rows = abs(shift_x), abs(shift_y)
    column = left + side - columns if shift_x > 0 else left
    row = top + side - rows if shift_y > 0 else top
    rest = left if shift_x > 0 else left + columns
    entered = [Cells(column, top, columns, side), Cells(rest, row, side - columns, rows)]
    return [one for one in entered if one.width and one.height]


def torus_parts(cells: Cells, side: int) -> list[TorusPart]:
    """Split a rectangle, at most as large as the torus, where the torus is closed.

    Args:
        cells: rectangle of the grid.
        side: cells per side of the torus.
    """
    return [
        TorusPart(
            (left // side, top // side),
            Cells(left % side, top % side, width, height),
            Cells(left, top, width, height),
        )
        for top, height in _intervals(cells.top, cells.height, side)
        for left, width in _intervals(cells.left, cells.width, side)
    ]


def _intervals(first: int, count: int, side: int) -> Iterator[tuple[int, int]]:
    """First and number of the cells in each period."""
    end = first + count
    while first < end:
        last = min(end, (first // side + 1) * side)
        yield first, last - first
        first = last
