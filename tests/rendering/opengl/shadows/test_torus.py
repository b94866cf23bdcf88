"""Squares of a grid on a torus: what enters them, and where it is kept."""

import numpy as np
import pytest

from omnisim.rendering.opengl.shadows.shadow_maps import Cells, entered_cells, torus_parts

SIDE = 8
MOVES = [(1, 0), (0, -1), (-2, 5), (-7, -7), (8, 0), (-3, 40), (0, 0)]


def _cells(rectangles):
    """Cells of rectangles, each as often as it is in one."""
    return [
        (x, y)
        for left, top, width, height in rectangles
        for x in range(left, left + width)
        for y in range(top, top + height)
    ]


@pytest.mark.parametrize("move", MOVES, ids=str)
def test_each_cell_enters_once(move):
    start = -5, 3
    end = start[0] + move[0], start[1] + move[1]
    old, new = (set(_cells([Cells(*first, SIDE, SIDE)])) for first in (start, end))
    entered = _cells(entered_cells(start, end, SIDE))
    assert len(entered) == len(set(entered))
    assert set(entered) == new - old
    assert set(_cells(entered_cells(None, end, SIDE))) == new


@pytest.mark.parametrize("move", MOVES, ids=str)
def test_a_moved_square_holds_all_of_its_cells(move):
    kept = np.full((SIDE, SIDE, 2), -1000)
    old = None
    for first in [(2, -3), (2 + move[0], -3 + move[1])]:
        for cells in entered_cells(old, first, SIDE):
            for part in torus_parts(cells, SIDE):
                x, y, width, height = part.place
                assert min(x, y) >= 0
                assert max(x + width, y + height) <= SIDE  # within one period
                assert (part.cells.left - x, part.cells.top - y) == (
                    SIDE * part.period[0],
                    SIDE * part.period[1],
                )
                columns, rows = np.meshgrid(np.arange(width), np.arange(height))
                kept[y : y + height, x : x + width, 0] = part.cells.left + columns
                kept[y : y + height, x : x + width, 1] = part.cells.top + rows
        old = first
    x, y = np.meshgrid(*(np.arange(SIDE) + one for one in first))
    np.testing.assert_array_equal(kept[y % SIDE, x % SIDE], np.stack((x, y), axis=-1))
