"""Seamless value noise: the subtle variation that keeps surfaces from looking like flat CAD."""

from __future__ import annotations

import numpy as np


def value_noise(
    height: int, width: int, cells_y: int, cells_x: int, rng: np.random.Generator
) -> np.ndarray:
    """One octave of smooth noise in 0..1 that repeats seamlessly at the image borders."""
    lattice = rng.random((cells_y, cells_x))
    y = np.arange(height) * cells_y / height
    x = np.arange(width) * cells_x / width
    y0, x0 = y.astype(int), x.astype(int)
    ty, tx = _ease(y - y0)[:, None], _ease(x - x0)[None, :]
    y1, x1 = (y0 + 1) % cells_y, (x0 + 1) % cells_x
    near = lattice[np.ix_(y0, x0)] * (1 - tx) + lattice[np.ix_(y0, x1)] * tx
    far = lattice[np.ix_(y1, x0)] * (1 - tx) + lattice[np.ix_(y1, x1)] * tx
    return near * (1 - ty) + far * ty


def fractal_noise(
    height: int,
    width: int,
    cells: int | tuple[int, int],
    octaves: int,
    rng: np.random.Generator,
) -> np.ndarray:
    """Sum of octaves, each twice as fine and half as strong, stretched to exactly 0..1."""
    cells_y, cells_x = (cells, cells) if isinstance(cells, int) else cells
    total = np.zeros((height, width))
    for octave in range(octaves):
        scale = 2**octave
        total += value_noise(height, width, cells_y * scale, cells_x * scale, rng) / scale
    return (total - total.min()) / (total.max() - total.min())


def blend(base: np.ndarray, other: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Mix two color images (or plain colors) by a weight image in 0..1."""
    weight = np.clip(weight, 0.0, 1.0)[..., None]
    return base * (1 - weight) + other * weight


def grid_cells(height: int, width: int, rows: int, columns: int) -> tuple[np.ndarray, ...]:
    """Row and column number of every pixel's cell, and its position in the cell (0..1)."""
    y = (np.arange(height) + 0.5) * rows / height
    x = (np.arange(width) + 0.5) * columns / width
    y, x = np.broadcast_arrays(y[:, None], x[None, :])
    return y.astype(int), x.astype(int), y % 1, x % 1


def smooth_step(low: float, high: float, value: np.ndarray) -> np.ndarray:
    """0 below low, 1 above high, an S-shaped ramp between."""
    return _ease(np.clip((value - low) / (high - low), 0.0, 1.0))


def _ease(t: np.ndarray) -> np.ndarray:
    return t * t * (3 - 2 * t)
