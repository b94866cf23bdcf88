"""From NumPy to what OpenGL's uniforms want."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def columns_first(matrices: NDArray[np.float64]) -> NDArray[np.float32]:
    """Matrices (..., n, n) as float32 in OpenGL's order, column after column."""
    return np.ascontiguousarray(np.swapaxes(matrices, -1, -2), dtype=np.float32)
