"""Corners of a chessboard of 9 × 7 squares in photographs, found by OpenCV.

`python examples/find_corners.py 0.04 corners.csv photos/*.png`: length of a square in meters, the
file to write, the photographs.
"""

import sys
from pathlib import Path

import cv2
import numpy as np

from omnisim.cameras.optics import BoardCorners, write_corners

PATTERN = (8, 6)  # inner corners along a row, and rows


def find(image: np.ndarray) -> np.ndarray | None:
    """Corners (n, 2) in a gray image, to a tenth of a pixel, or None."""
    found, corners = cv2.findChessboardCornersSB(image, PATTERN, flags=cv2.CALIB_CB_EXHAUSTIVE)
    if not found:
        return None
    corners = corners.reshape(-1, 2)
    steps = np.linalg.norm(corners[:, None] - corners, axis=2)
    window = max(2, int(steps[steps > 0.0].min() / 3.0))  # up to the next corner
    stop = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 100, 1e-4)
    return cv2.cornerSubPix(image, corners, (window, window), (-1, -1), stop).astype(float)


def main(square_m: float, target: Path, paths: list[Path]) -> None:
    """Find the corners, and write them."""
    columns, rows = np.meshgrid(np.arange(PATTERN[0]), np.arange(PATTERN[1]))
    points_m = square_m * np.column_stack((columns.ravel(), rows.ravel()))
    boards = []
    for path in paths:
        corners = find(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE))
        if corners is None:
            print(f"{path}: no whole board")
        else:
            boards.append(BoardCorners(points_m, corners))
    write_corners(target, boards)
    print(f"{target}: boards of {len(boards)} photographs")


if __name__ == "__main__":
    main(float(sys.argv[1]), Path(sys.argv[2]), [Path(path) for path in sys.argv[3:]])
