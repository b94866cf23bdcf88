"""Projections by OpenCV from a calibration file in its own format.

`cv2.FileStorage` reads the file, as in any program with OpenCV. A mirror's file is in a mirrored
frame, see `omnidir`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray


def project(path: Path, format: str, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pixels (n, 2) of points (n, 3) in the frame of the file.

    Args:
        path: calibration file.
        format: opencv_omnidir, opencv_fisheye or opencv_pinhole.
        points: (n, 3) in meters, z forward.
    """
    import cv2

    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    matrix = file.getNode("camera_matrix").mat()
    distortion = file.getNode("distortion_coefficients").mat().ravel()
    xi = file.getNode("xi").real() if format == "opencv_omnidir" else 0.0
    file.release()
    zero = np.zeros(3)
    column = np.ascontiguousarray(points, dtype=np.float64)[:, None]
    if format == "opencv_omnidir":
        pixels, _ = cv2.omnidir.projectPoints(column, zero, zero, matrix, xi, distortion[:4])
    elif format == "opencv_fisheye":
        pixels, _ = cv2.fisheye.projectPoints(column, zero, zero, matrix, distortion[:4])
    else:
        pixels, _ = cv2.projectPoints(column, zero, zero, matrix, distortion)
    return np.asarray(pixels, dtype=np.float64).reshape(-1, 2)
