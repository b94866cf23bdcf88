"""Hits of the rays of a picture's pixels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Hits(NamedTuple):
    """Hits of each pixel's ray; first row at the top.

    The viewpoint frame has the world's axes and its origin in the effective viewpoint.
    """

    points_and_ranges_m: NDArray[np.float32]  # (height, width, 4), see below
    draws_plus_one: NDArray[np.uint32]  # (height, width), 1 + draw item; 0: nothing is hit
    triangles: NDArray[np.uint32]  # (height, width) of the instance's mesh
    normals: NDArray[np.float32]  # (height, width, 3), viewpoint frame, unit; 0: nothing is hit
    albedos: NDArray[np.float32]  # (height, width, 3) linear RGB; 0: nothing is hit

    @property
    def points_m(self) -> NDArray[np.float32]:
        """Points (height, width, 3), viewpoint frame; where nothing is hit, directions."""
        return self.points_and_ranges_m[..., :3]

    @property
    def ranges_m(self) -> NDArray[np.float32]:
        """Ranges (height, width); +inf: nothing is hit."""
        return self.points_and_ranges_m[..., 3]
