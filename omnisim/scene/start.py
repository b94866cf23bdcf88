"""Default pose of the camera in a scene that states none."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.scene.parts import StartPose

# Default height of the effective viewpoint above the floor: a small robot's.
DEFAULT_HEIGHT_M = 1.0


def default_start(bounds: NDArray[np.float64]) -> StartPose:
    """Start pose in the middle of bounds (2, 3), world."""
    low, high = bounds
    x, y = 0.5 * (low[:2] + high[:2])
    z = low[2] + min(DEFAULT_HEIGHT_M, 0.5 * (high[2] - low[2]))
    return StartPose((float(x), float(y), float(z)))
