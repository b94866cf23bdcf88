"""Types of NumPy arrays by their elements; shapes and units are stated where they are used."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating]  # of either precision
Float32s = NDArray[np.float32]
Float64s = NDArray[np.float64]
Int32s = NDArray[np.int32]
UInt32s = NDArray[np.uint32]
Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]
