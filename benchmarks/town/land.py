"""Plots for houses along parallel streets, nearest to the start first."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.town.street import BACK_M, PLOT_WIDTH_M, ROAD_MIDDLE_M

STREET_PITCH_M = 2.0 * (BACK_M - ROAD_MIDDLE_M)
COLUMNS, STREETS = 256, 128
BLOCK_COLUMNS, BLOCK_STREETS = 16, 2
# The viewpoint starts in the middle of the first street, in front of the first house.
START_X_M = 0.5 * PLOT_WIDTH_M
_SEED = 11


@dataclass(frozen=True, eq=False)
class Plots:
    """Plots for houses.

    Attributes:
        position_m: (n, 3) middles of the houses, world.
        side: (n,) side of the street: 1 for houses with their front toward −y, else −1.
        block: (n,) index of the plot's block of neighbors.
        random: (n, 5) numbers from 0 to 1, equal for a plot in all towns.
    """

    position_m: NDArray[np.float64]
    side: NDArray[np.float64]
    block: NDArray[np.intp]
    random: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.side)

    def first(self, count: int) -> Plots:
        """The `count` plots nearest to the start."""
        block = np.unique(self.block[:count], return_inverse=True)[1]
        return Plots(self.position_m[:count], self.side[:count], block, self.random[:count])

    @property
    def house_from_plot(self) -> NDArray[np.float64]:
        """Rotations (n, 3, 3) of the houses: a half turn on the other side of the street."""
        rotations = np.zeros((len(self), 3, 3))
        rotations[:, 0, 0] = rotations[:, 1, 1] = self.side
        rotations[:, 2, 2] = 1.0
        return rotations


def land() -> Plots:
    """All available plots."""
    columns, streets = np.arange(COLUMNS) - COLUMNS // 2, np.arange(STREETS) - STREETS // 2
    column, street, side = (
        values.ravel() for values in np.meshgrid(columns, streets, np.array([1.0, -1.0]))
    )
    x = (column + 0.5) * PLOT_WIDTH_M
    y = street * STREET_PITCH_M - side * ROAD_MIDDLE_M
    random = np.random.default_rng(_SEED).uniform(0.0, 1.0, (len(x), 5))
    block = column // BLOCK_COLUMNS * STREETS + street // BLOCK_STREETS
    # rounded, so that ties are equal on every machine; then sorted by side and column
    order = np.lexsort((side, column, np.round(np.hypot(x - START_X_M, y), 6)))
    position_m = np.stack((x, y, np.zeros(len(x))), axis=-1)
    return Plots(position_m[order], side[order], block[order], random[order])
