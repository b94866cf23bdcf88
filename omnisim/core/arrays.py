"""Types of arrays by their elements, and bounds and normals of points and triangles."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

AnyFloats = NDArray[np.floating]  # of either precision
Floats = NDArray[np.float64]
Floats32 = NDArray[np.float32]
Bytes = NDArray[np.uint8]
Ints = NDArray[np.int64]
Ints32 = NDArray[np.int32]
Uints32 = NDArray[np.uint32]
Indices = NDArray[np.intp]
Bools = NDArray[np.bool_]
_Number = TypeVar("_Number", bound=np.generic)


def bounds_of(points: NDArray[_Number]) -> NDArray[_Number]:
    """Minimum and maximum coordinates (2, k) of points (n, k).

    The points are transposed first: NumPy is about twenty times as fast along contiguous rows.
    """
    rows: NDArray[Any] = np.ascontiguousarray(points.T)
    return np.stack((rows.min(axis=1), rows.max(axis=1)))


def triangle_bounds(corners: NDArray[_Number]) -> tuple[NDArray[_Number], NDArray[_Number]]:
    """Minimum and maximum coordinates (n, ...) of triangle corners (n, 3, ...)."""
    first, second, third = corners[:, 0], corners[:, 1], corners[:, 2]
    low = np.minimum(np.minimum(first, second), third)
    return low, np.maximum(np.maximum(first, second), third)


def triangle_crosses(corners: AnyFloats) -> AnyFloats:
    """Normals (n, 3) of triangles (n, 3, 3), twice as long as their areas."""
    crosses: AnyFloats = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return crosses
