"""Depth limits of rays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.rays.caster import Rays


@dataclass(frozen=True)
class DepthLimits:
    """Depth limits equal to the clipping planes of the virtual cameras: faces of two cubes.

    Attributes:
        near_m, far_m: half the side lengths of the cubes.
    """

    near_m: float
    far_m: float

    def aim(self, rig: NDArray[np.float64], world_from_rig: NDArray[np.float64]) -> Rays:
        """Rays in the world along unit directions (n, 3), rig frame, from a pose (4, 4)."""
        depths = np.abs(rig).max(axis=1)
        return Rays(
            np.tile(world_from_rig[:3, 3], (len(rig), 1)),
            np.einsum("nj,ij->ni", rig, world_from_rig[:3, :3]),
            self.near_m / depths,
            self.far_m / depths,
        )
