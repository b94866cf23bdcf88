"""Gray images for estimators."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

LUMA = np.array((0.299, 0.587, 0.114), dtype=np.float32)  # ITU-R BT.601, as in OpenCV


def gray(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Gray image (height, width) of an sRGB image (height, width, 3)."""
    return np.rint(image.astype(np.float32) @ LUMA).astype(np.uint8)
