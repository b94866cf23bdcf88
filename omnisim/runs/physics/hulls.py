"""Convex hulls of points, without Qhull's warnings."""

from __future__ import annotations

import numpy as np
import scipy  # its submodules load when first used
from numpy.typing import NDArray


def convex_hull(points: NDArray[np.float64]) -> scipy.spatial.ConvexHull | None:
    """Hull of points (n, axes); None: they are degenerate (flat)."""
    try:
        return scipy.spatial.ConvexHull(points, qhull_options="Pp")
    except scipy.spatial.QhullError:
        return None
