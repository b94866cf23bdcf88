"""Fog along rays, in NumPy: the twin of shaders/scene/fog.glsl."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.scene.model import Fog


def fogged(
    fog: Fog, colors: NDArray[np.float32], ranges_m: NDArray[np.float64]
) -> NDArray[np.float32]:
    """Linear colors (n, 3) seen through fog from distances (n,)."""
    left = np.exp(-np.array(fog.attenuation_per_m) * ranges_m[:, None])
    colored = np.array(fog.color)
    return (colored + (colors - colored) * left).astype(np.float32)
