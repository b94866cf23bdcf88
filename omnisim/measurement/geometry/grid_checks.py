"""Checks of detected corner grids: order, orientation and the colors of their squares."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

MAX_STRETCH = 3.0  # of neighboring distances along a line of corners; a fisheye's edge has 1.6
MAX_BEND_COSINE = 0.6  # of neighboring steps along a line: 53°
MAX_WRONG_SQUARES = 0.05  # share; a hand, a shadow or a reflection hides some
Grid = NDArray[np.float64]  # (rows, columns, 2) positions in the image


def cell_areas_px2(grid: Grid) -> NDArray[np.float64]:
    """Signed areas (rows - 1, columns - 1) of a grid's cells, px²; positive: front side seen."""
    first, second = grid[1:, 1:] - grid[:-1, :-1], grid[1:, :-1] - grid[:-1, 1:]
    areas: NDArray[np.float64] = 0.5 * (
        first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]
    )
    return areas


def grid_fault(grid: Grid) -> str | None:
    """Fault in the order of a grid's corners, or None.

    Corners of a flat board lie on smooth lines through any lens: all cells have the same
    orientation, and neighboring steps along a line differ little in length and direction.
    """
    areas = cell_areas_px2(grid)
    if areas.min() <= 0.0 <= areas.max():
        return "its corners are in no grid's order"
    for lines in (grid, grid.swapaxes(0, 1)):
        steps = np.diff(lines, axis=1)
        lengths = np.linalg.norm(steps, axis=2)
        ratios = lengths[:, 1:] / lengths[:, :-1]
        cosines = (steps[:, 1:] * steps[:, :-1]).sum(axis=2) / (lengths[:, 1:] * lengths[:, :-1])
        if max(ratios.max(), 1.0 / ratios.min()) > MAX_STRETCH or cosines.min() < MAX_BEND_COSINE:
            return "its lines of corners jump"
    return None


def squares_fault(image: NDArray[np.uint8], grid: Grid) -> str | None:
    """Fault in the colors of the squares between a grid's corners, or None.

    Args:
        image: (height, width) gray image.
        grid: corners of a chessboard.
    """
    levels = _square_levels(image, grid)
    signs = _signs(levels.shape)
    contrasts = []
    for axis in (0, 1):  # differences between neighbors: light may change across the board
        contrasts.append((np.diff(levels, axis=axis) * np.delete(signs, 0, axis=axis)).ravel())
    contrast = np.concatenate(contrasts)
    contrast *= np.sign(np.median(contrast))
    wrong = float(np.mean(contrast <= 0.0))
    if wrong > MAX_WRONG_SQUARES:
        return f"{100.0 * wrong:.0f} % of neighboring squares are not black beside white"
    return None


def size_fault(image: NDArray[np.uint8], grid: Grid) -> str | None:
    """Fault if squares continue beyond a grid's outermost ones, or None.

    Args:
        image: (height, width) gray image.
        grid: corners of a chessboard.
    """
    inner = _square_levels(image, grid)
    contrast = abs(float((inner * _signs(inner.shape)).mean()))
    wider = grid
    for axis in (0, 1, 0, 1):
        first = 2.0 * np.take(wider, [0], axis) - np.take(wider, [1], axis)
        last = 2.0 * np.take(wider, [-1], axis) - np.take(wider, [-2], axis)
        wider = np.concatenate((first, wider, last), axis)
    levels = _square_levels(image, wider)
    height, width = image.shape
    is_in: NDArray[np.bool_] = np.all((wider >= 0.0) & (wider < (width, height)), axis=2)
    inside = is_in[1:, 1:] & is_in[:-1, :-1] & is_in[1:, :-1] & is_in[:-1, 1:]
    for side in (np.s_[0, 2:-2], np.s_[-1, 2:-2], np.s_[2:-2, 0], np.s_[2:-2, -1]):
        steps = np.diff(levels[side]) * _signs((levels[side].size - 1,))
        if inside[side].all() and abs(float(steps.mean())) > contrast:  # half of a step's size
            return "its squares continue beyond the board: expected more corners"
    return None


def is_first_square_white(image: NDArray[np.uint8], grid: Grid) -> bool:
    """True if the square between a grid's first corners is white."""
    levels = _square_levels(image, grid)
    signs = _signs(levels.shape)
    return bool((levels * signs).sum() / signs.size > np.mean(levels) * signs.mean())


def _square_levels(image: NDArray[np.uint8], grid: Grid) -> NDArray[np.float32]:
    """Gray levels (rows - 1, columns - 1) in the middle of a grid's squares."""
    centers = 0.25 * (grid[1:, 1:] + grid[:-1, :-1] + grid[1:, :-1] + grid[:-1, 1:])
    positions = np.moveaxis(centers[..., ::-1], -1, 0)
    levels: NDArray[np.float32] = map_coordinates(
        image.astype(np.float32), positions, order=1, mode="nearest"
    )
    return levels


def _signs(shape: tuple[int, ...]) -> NDArray[np.float64]:
    """1 and -1 alternately, as the squares of a chessboard of shape (rows, columns)."""
    signs: NDArray[np.float64] = 1.0 - 2.0 * (np.indices(shape).sum(axis=0) % 2)
    return signs
