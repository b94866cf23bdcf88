"""Markers of ChArUco boards and AprilGrids: OpenCV's dictionaries, detectors and bits."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.measurement.geometry.boards import CharucoBoard

TAG_BORDER_BITS = 2  # width of the black border of Kalibr's tags
_MARKER_BORDER_BITS = 1
Bools = NDArray[np.bool_]


@lru_cache(maxsize=1)
def charuco_detector(board: CharucoBoard) -> Any:
    """Detector of a ChArUco board."""
    import cv2

    return cv2.aruco.CharucoDetector(_printed_charuco(board))


@lru_cache(maxsize=1)
def tag_detector() -> Any:
    """Detector of Kalibr's tags."""
    import cv2

    parameters = cv2.aruco.DetectorParameters()
    parameters.markerBorderBits = TAG_BORDER_BITS
    return cv2.aruco.ArucoDetector(_tags(), parameters)


def charuco_markers(board: CharucoBoard) -> dict[tuple[int, int], Bools]:
    """Cells (n, n) of markers with their borders, True for ink, by row and column of the square."""
    printed = _printed_charuco(board)
    dictionary = printed.getDictionary()
    cells = dictionary.markerSize + 2 * _MARKER_BORDER_BITS
    markers = {}
    for number, corners in zip(printed.getIds().ravel(), printed.getObjPoints(), strict=True):
        column, row = (int(value // board.square_m) for value in np.mean(corners, axis=0)[:2])
        image = dictionary.generateImageMarker(int(number), cells, borderBits=_MARKER_BORDER_BITS)
        markers[row, column] = image == 0
    return markers


def tag_cells(number: int) -> Bools:
    """Cells (n, n) of Kalibr's tag with its border, True for ink, as OpenCV draws it."""
    dictionary = _tags()
    cells = dictionary.markerSize + 2 * TAG_BORDER_BITS
    is_black: Bools = dictionary.generateImageMarker(number, cells, borderBits=TAG_BORDER_BITS) == 0
    return is_black


def _printed_charuco(board: CharucoBoard) -> Any:
    import cv2

    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{board.dictionary}"))
    size = board.columns, board.rows
    return cv2.aruco.CharucoBoard(size, board.square_m, board.marker_m, dictionary)


def _tags() -> Any:
    import cv2

    return cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
