"""Corners of a scene in a camera's image, tracked into the twin's image by OpenCV.

Sources: Shi & Tomasi, "Good features to track" (CVPR 1994), for the corners; Lucas & Kanade (1981),
in Bouguet's pyramid, for their offsets; Kalal et al., "Forward-backward error" (ICPR 2010), for the
rejection of wrong ones.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras.camera import CentralCamera

Floats = NDArray[np.float64]
Gray = NDArray[np.uint8]
MAX_OFFSET_PX = 12.0  # of a corner; the pyramid's reach
_MAX_CORNERS = 500  # per image
_QUALITY, _DISTANCE_PX = 0.02, 8.0  # of the corners: share of the best one, and spacing
_WINDOW_PX, _LEVELS = 15, 2
_MAX_RETURN_PX = 0.1  # from a corner to where it is tracked back to
_MIN_CORRELATION = 0.8  # of the windows around a corner in both images
_SMOOTH_PX = 8.0  # standard deviation of the local mean and contrast
_MIN_CONTRAST = 3.0  # gray levels


def seen_field(camera: CentralCamera) -> Gray:
    """Mask (height, width) of pixels with a ray whose neighborhood has rays, too; 255: True."""
    import cv2

    rows, columns = np.mgrid[: camera.height_px, : camera.width_px]
    pixels = np.stack((columns, rows), axis=-1).reshape(-1, 2).astype(np.float64)
    valid = camera.ray_from_pixel(pixels).valid.reshape(camera.height_px, camera.width_px)
    kernel = np.ones((_WINDOW_PX + 2, _WINDOW_PX + 2), dtype=np.uint8)
    mask: Any = cv2.erode(valid.astype(np.uint8), kernel, borderValue=0)
    return np.asarray(255 * mask, dtype=np.uint8)


def track_corners(image: Gray, twin: Gray, field: Gray) -> tuple[Floats, Floats]:
    """Corners (n, 2) in an image, and their offsets (n, 2) in the twin's; NaN: not found.

    Brightness and contrast may differ: both images are normalized around each pixel first.

    Args:
        image: (height, width) gray image of the camera.
        twin: (height, width) gray image of the twin.
        field: (height, width) mask of pixels where corners are searched.
    """
    import cv2

    found: Any = cv2.goodFeaturesToTrack(image, _MAX_CORNERS, _QUALITY, _DISTANCE_PX, mask=field)
    if found is None:
        return np.zeros((0, 2)), np.zeros((0, 2))
    one, other = _normalized(image), _normalized(twin)
    options: dict[str, Any] = {
        "winSize": (_WINDOW_PX, _WINDOW_PX),
        "maxLevel": _LEVELS,
        "criteria": (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 50, 1e-3),
    }
    unknown: Any = None
    there, is_there, _ = cv2.calcOpticalFlowPyrLK(one, other, found, unknown, **options)
    back, is_back, _ = cv2.calcOpticalFlowPyrLK(other, one, there, unknown, **options)
    offsets = (there - found).reshape(-1, 2).astype(np.float64)
    returned = np.linalg.norm((back - found).reshape(-1, 2), axis=1)
    is_found = (is_there.ravel() == 1) & (is_back.ravel() == 1) & (returned <= _MAX_RETURN_PX)
    is_found &= np.linalg.norm(offsets, axis=1) <= MAX_OFFSET_PX
    corners = found.reshape(-1, 2).astype(np.float64)
    for index in np.flatnonzero(is_found).tolist():
        first, second = _window(one, corners[index]), _window(other, (corners + offsets)[index])
        correlation = float(np.corrcoef(first, second)[0, 1])
        is_found[index] = correlation >= _MIN_CORRELATION  # False for NaN
    return corners, np.where(is_found[:, None], offsets, np.nan)


def _window(image: Gray, center_px: Floats) -> Floats:
    """Pixels (n,) of the window around a position in an image."""
    import cv2

    center = float(center_px[0]), float(center_px[1])
    window: Any = cv2.getRectSubPix(image, (_WINDOW_PX, _WINDOW_PX), center)
    return np.asarray(window, dtype=np.float64).ravel()


def _normalized(image: Gray) -> Gray:
    """Image with its local mean at 128 and its local standard deviation at 40 levels."""
    import cv2

    levels = image.astype(np.float32)
    mean: Any = cv2.GaussianBlur(levels, (0, 0), _SMOOTH_PX)
    variance: Any = cv2.GaussianBlur(np.square(levels - mean), (0, 0), _SMOOTH_PX)
    contrast = np.sqrt(variance) + _MIN_CONTRAST
    normalized: Gray = np.clip(128.5 + 40.0 * (levels - mean) / contrast, 0.0, 255.0).astype(
        np.uint8
    )
    return normalized
