"""Corners of a board in one image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class BoardView:
    """Corners of a board in one image.

    Attributes:
        name: image file, or another name of the image.
        points_m: (n, 2) positions on the flat board: x along the rows, y along the columns.
        pixels_px: (n, 2) positions in the image.
    """

    name: str
    points_m: NDArray[np.float64]
    pixels_px: NDArray[np.float64]

    @property
    def points_3d_m(self) -> NDArray[np.float64]:
        """Corners (n, 3) in the board's frame, z = 0."""
        return np.column_stack((self.points_m, np.zeros(len(self.points_m))))


@dataclass(frozen=True)
class RejectedImage:
    """Image without a usable board.

    Attributes:
        name: image file.
        reason: reason why the image has no usable board.
    """

    name: str
    reason: str
