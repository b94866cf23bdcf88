"""OpenCV's omnidirectional module: Mei's unified model in an independent implementation.

OpenCV's z axis points along the mirror's axis, toward the scene: its frame is (x, y, −z) of our
optical frame. This frame is mirrored, which no rotation vector can express, so points are mirrored
before the call.

Source: Mei & Rives, "Single view point omnidirectional camera calibration from planar grids",
2007; OpenCV's module ccalib.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from omnisim.cameras import HyperbolicCamera
from omnisim.core.arrays import Bytes, Floats

OMNIDIR_FROM_OPTICAL: Floats = np.diag([1.0, 1.0, -1.0])


class OmnidirCalibration(NamedTuple):
    """Parameters estimated by OpenCV."""

    xi: float
    focal_length_px: float  # mean of both, Mei's γ
    principal_point_px: Floats  # (2,)
    rms_px: float
    boards: int  # number of used boards


def project(camera: HyperbolicCamera, points: Floats) -> Floats:
    """Pixels (n, 2) of points (n, 3), optical frame, with the camera's K and ξ."""
    import cv2

    mirrored = np.ascontiguousarray(points @ OMNIDIR_FROM_OPTICAL)[:, None]
    focal, (u, v) = camera.unified_focal_length_px, camera.principal_point_px
    matrix = np.array([[focal, 0.0, u], [0.0, focal, v], [0.0, 0.0, 1.0]])
    zero = np.zeros(3)
    xi = camera.mirror.xi
    pixels, _ = cv2.omnidir.projectPoints(mirrored, zero, zero, matrix, xi, np.zeros(4))
    return np.asarray(pixels, dtype=np.float64).reshape(-1, 2)


def calibrate(
    board_points: Floats, images_px: list[Floats], size_px: tuple[int, int], distorted: bool = False
) -> OmnidirCalibration:
    """Calibrate from corners of one plane board in several images.

    Args:
        board_points: (n, 3) corners in the board's frame.
        images_px: (n, 2) the same corners in each image.
        size_px: width and height of the images.
        distorted: also estimate radial and tangential distortion; otherwise they are zero.
    """
    import cv2

    objects = [board_points[:, None].astype(np.float64) for _ in images_px]
    images = [pixels[:, None].astype(np.float64) for pixels in images_px]
    flags = cv2.omnidir.CALIB_FIX_SKEW
    for name in () if distorted else ("K1", "K2", "P1", "P2"):
        flags |= getattr(cv2.omnidir, f"CALIB_FIX_{name}")
    stop = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 500, 1e-9)
    # its stub requires initial K, ξ and D
    rms, matrix, xi, _, _, _, used = cv2.omnidir.calibrate(  # type: ignore[call-overload]
        objects, images, size_px, None, None, None, flags, stop
    )
    return OmnidirCalibration(
        float(np.ravel(xi)[0]),
        float(0.5 * (matrix[0, 0] + matrix[1, 1])),
        matrix[:2, 2],
        float(rms),
        int(np.size(used)),
    )


def find_corners(image: Bytes, pattern: tuple[int, int]) -> Floats | None:
    """Inner corners (n, 2) of a chessboard in a gray image; None: not found.

    Args:
        image: (height, width) uint8.
        pattern: numbers of inner corners per row and per column.
    """
    import cv2

    is_found, corners = cv2.findChessboardCornersSB(image, pattern)
    if not is_found:
        return None
    rough = np.ascontiguousarray(corners.reshape(-1, 2), dtype=np.float32)
    # Finds the corners of a bent board; the edges that meet in them then locate them to a tenth of
    # a pixel, as far as the next corner leaves room.
    spacing_px = min(
        np.linalg.norm(np.delete(rough, index, axis=0) - corner, axis=1).min()
        for index, corner in enumerate(rough)
    )
    window = max(2, int(spacing_px / 3.0))
    stop = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 100, 1e-4)
    fine = cv2.cornerSubPix(image, rough[:, None].copy(), (window, window), (-1, -1), stop)
    return fine.reshape(-1, 2).astype(np.float64)


def project_by_file(path: Path, format: str, points: Floats) -> Floats:
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
