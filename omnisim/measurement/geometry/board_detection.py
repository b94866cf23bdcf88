"""Detection of calibration boards in images by OpenCV, with checks of the corners it returns.

Sources: Duda & Frese, "Accurate detection and localization of checkerboard corners for
calibration" (BMVC 2018), as `cv2.findChessboardCornersSB`; OpenCV's module `aruco`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import MeasurementError
from omnisim.measurement.geometry.board_markers import charuco_detector, tag_detector
from omnisim.measurement.geometry.board_view import BoardView
from omnisim.measurement.geometry.boards import AprilGrid, Board, CharucoBoard, Chessboard
from omnisim.measurement.geometry.grid_checks import (
    cell_areas_px2,
    grid_fault,
    is_first_square_white,
    size_fault,
    squares_fault,
)

MIN_CORNERS = 12  # of boards with tags, which may be seen in part
_LARGE_PX = 1000  # shorter side of images whose chessboards are searched for at half the size
_SMALL_PX = 16  # shorter side that OpenCV needs for its threshold; no board fits into less
_REACH = 1.0 / 3.0  # of the way to the next corner, whose edges would disturb
_MAX_WINDOW_PX = 9
_MIN_WINDOW_PX = 2


def find_board(
    image: NDArray[np.uint8], board: Board, name: str = "image", mirrored: bool = False
) -> BoardView:
    """Find a board's corners in an image.

    Args:
        image: (height, width) gray image.
        board: the board.
        name: name of the image.
        mirrored: the camera looks into a mirror, so the image shows the board mirrored.

    Raises:
        MeasurementError: no board, another board, or wrong corners; the message does not name the
            image.
    """
    seen = np.ascontiguousarray(image[:, ::-1]) if mirrored else image
    if isinstance(board, Chessboard):
        points, pixels = _chessboard(seen, board)
    elif isinstance(board, CharucoBoard):
        points, pixels = _charuco(seen, board)
    else:
        points, pixels = _april_grid(seen, board)
    if mirrored:
        pixels[:, 0] = image.shape[1] - 1.0 - pixels[:, 0]
    return BoardView(name, points, pixels)


Corners = tuple[NDArray[np.float64], NDArray[np.float64]]  # points (n, 2) in m, pixels (n, 2)


def _chessboard(image: NDArray[np.uint8], board: Chessboard) -> Corners:
    """Corners of a chessboard; in large images, it is searched for at half the size first."""
    import cv2

    if min(image.shape) >= _LARGE_PX:
        half = np.asarray(cv2.pyrDown(image), dtype=np.uint8)
        grid = _larger_grid(half, (board.columns, board.rows))
        if grid is not None:
            try:
                return _chessboard_corners(image, board, 2.0 * grid)
            except MeasurementError:
                pass  # a small or distant board may be found in the whole image only
    return _chessboard_corners(image, board, _larger_grid(image, (board.columns, board.rows)))


def _chessboard_corners(
    image: NDArray[np.uint8], board: Chessboard, grid: NDArray[np.float64] | None
) -> Corners:
    """Corners of a chessboard, located from a rough grid (rows, columns, 2) or None.

    Raises:
        MeasurementError: no board of this size, or wrong corners.
    """
    import cv2

    size = board.columns, board.rows
    if grid is None or grid.shape[:2] != (board.rows, board.columns):
        # the outer edges of the outermost squares may pass for corners: the size as it should be
        is_found, corners = _by_quadrangles(image, size)
        if not is_found:
            flags = cv2.CALIB_CB_EXHAUSTIVE
            is_found, corners = cv2.findChessboardCornersSB(image, size, flags=flags)
        if not is_found:
            seen = "" if grid is None else f", but of {grid.shape[1]} x {grid.shape[0]}"
            wanted = f"{board.columns} x {board.rows} inner corners"
            raise MeasurementError(f"no chessboard of {wanted}{seen}")
        grid = corners.reshape(board.rows, board.columns, 2).astype(np.float64)
    if np.median(cell_areas_px2(grid)) < 0.0:
        grid = grid[:, ::-1]  # OpenCV's order does not say from which side
    fault = grid_fault(grid)
    if fault is None:
        grid = _refined(image, grid)
        fault = grid_fault(grid) or squares_fault(image, grid) or size_fault(image, grid)
    if fault is not None:
        raise MeasurementError(fault)
    if (board.rows + board.columns) % 2 == 1 and is_first_square_white(image, grid):
        grid = grid[::-1, ::-1]  # one way round, in all images
    y, x = np.mgrid[: board.rows, : board.columns]
    points = np.stack((x.ravel(), y.ravel()), axis=1) * board.square_m
    return points, grid.reshape(-1, 2)


def _by_quadrangles(image: NDArray[np.uint8], size: tuple[int, int]) -> tuple[bool, Any]:
    """OpenCV's search for black quadrangles: True if all corners are found, and the corners.

    Large images are searched at half their size, as the search takes seconds where there is no
    board.
    """
    import cv2

    if min(image.shape) < _SMALL_PX:
        return False, None
    if min(image.shape) < _LARGE_PX:
        return cv2.findChessboardCorners(image, size)
    is_found, corners = cv2.findChessboardCorners(cv2.pyrDown(image), size)
    return is_found, 2.0 * corners if is_found else corners


def _larger_grid(image: NDArray[np.uint8], size: tuple[int, int]) -> NDArray[np.float64] | None:
    """Corners (rows, columns, 2) of a chessboard of at least `size` inner corners, or None."""
    import cv2

    flags = cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_LARGER
    is_found, corners, meta = cv2.findChessboardCornersSBWithMeta(image, size, flags)
    if not is_found:
        return None
    grid: NDArray[np.float64] = corners.reshape(*meta.shape, 2).astype(np.float64)
    is_turned = (
        meta.shape[0] > meta.shape[1] if size[0] >= size[1] else meta.shape[0] < meta.shape[1]
    )
    return grid.swapaxes(0, 1) if is_turned else grid


def _refined(image: NDArray[np.uint8], grid: NDArray[np.float64]) -> NDArray[np.float64]:
    """Corners (rows, columns, 2) at sub-pixel accuracy, each from a third of the spacing."""
    spacing = np.full(grid.shape[:2], np.inf)
    for axis in (0, 1):
        steps = np.linalg.norm(np.diff(grid, axis=axis), axis=2)
        for ends in (np.s_[:-1], np.s_[1:]):
            part = spacing[ends] if axis == 0 else spacing[:, ends]
            np.minimum(part, steps, out=part)
    reach = np.clip(spacing * _REACH, _MIN_WINDOW_PX, _MAX_WINDOW_PX).astype(np.int64)
    refined = grid.copy()
    for window in np.unique(reach).tolist():
        chosen = reach == window
        refined[chosen] = _located(image, grid[chosen], window)
    return refined


def _located(
    image: NDArray[np.uint8], corners: NDArray[np.float64], window: int
) -> NDArray[np.float64]:
    """Saddle points (n, 2) near corners (n, 2), from windows of 2 `window` + 1 px."""
    import cv2

    stop = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 100, 1e-4)
    rough = corners.astype(np.float32).reshape(-1, 1, 2).copy()
    fine = cv2.cornerSubPix(image, rough, (window, window), (-1, -1), stop)
    return fine.reshape(-1, 2).astype(np.float64)


def _charuco(image: NDArray[np.uint8], board: CharucoBoard) -> Corners:
    pixels, ids, _, tags = charuco_detector(board).detectBoard(image)
    if ids is None or len(ids) < MIN_CORNERS:
        seen = 0 if ids is None else len(ids)
        markers = 0 if tags is None else len(tags)
        hint = _mirror_hint(image, charuco_detector(board).detectBoard, 3) if seen == 0 else ""
        raise MeasurementError(
            f"{seen} corners of the ChArUco board ({markers} markers): expected {MIN_CORNERS}{hint}"
        )
    numbers = ids.ravel()
    columns = board.columns - 1
    x, y = numbers % columns + 1, numbers // columns + 1
    points = np.stack((x, y), axis=1) * board.square_m
    rough = pixels.reshape(-1, 2).astype(np.float64)
    share = 0.5 * (board.square_m - board.marker_m) / board.square_m  # of a square, beside markers
    window = _window(_shortest_px(rough) * min(_REACH, share))
    return _checked(points, *_kept(rough, _located(image, rough, window), window))


def _april_grid(image: NDArray[np.uint8], board: AprilGrid) -> Corners:
    tags, ids, _ = tag_detector().detectMarkers(image)
    numbers = np.zeros(0, dtype=np.int64) if ids is None else ids.ravel()
    known = numbers < board.columns * board.rows
    if 4 * known.sum() < MIN_CORNERS:
        hint = _mirror_hint(image, tag_detector().detectMarkers, 1)
        raise MeasurementError(
            f"{known.sum()} tags of the AprilGrid: expected {MIN_CORNERS // 4}{hint}"
        )
    pixels = np.concatenate([tags[index] for index in np.flatnonzero(known)])
    shortest = np.linalg.norm(pixels - np.roll(pixels, 1, axis=1), axis=2).min()
    window = _window(float(shortest) * min(_REACH, board.spacing))
    rough = pixels.reshape(-1, 2).astype(np.float64)
    fine, is_kept = _kept(rough, _located(image, rough, window), window)
    # the detector's corners are inside the tag by some pixels: again, from close by
    fine = _located(image, fine, max(window // 2, _MIN_WINDOW_PX))
    pitch_m = board.tag_m * (1.0 + board.spacing)
    column, row = numbers[known] % board.columns, numbers[known] // board.columns
    lower_left = np.stack((column, -row), axis=1) * pitch_m  # y is down
    corners = board.tag_m * np.array([[0.0, -1.0], [1.0, -1.0], [1.0, 0.0], [0.0, 0.0]])
    # printed tags may be rotated against OpenCV's: the rotation that makes a plane of them
    turns = [
        (lower_left[:, None] + np.roll(corners, turn, axis=0)).reshape(-1, 2) for turn in range(4)
    ]
    points = min(turns, key=lambda one: _plane_residual(one[is_kept], fine[is_kept]))
    return _checked(points, fine, is_kept)


def _window(reach_px: float) -> int:
    """Half the side of the window for a reach, from 2 to 9 px."""
    return int(np.clip(reach_px, _MIN_WINDOW_PX, _MAX_WINDOW_PX))


def _shortest_px(corners: NDArray[np.float64]) -> float:
    """Smallest distance between corners (n, 2)."""
    distances = np.linalg.norm(corners[:, None] - corners, axis=2)
    np.fill_diagonal(distances, np.inf)
    return float(distances.min())


def _kept(
    rough: NDArray[np.float64], fine: NDArray[np.float64], window: int
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Located corners (n, 2), and a mask (n,): False if far from the corner's rough position."""
    return fine, np.linalg.norm(fine - rough, axis=1) <= max(0.5 * window, 1.0)


def _checked(
    points: NDArray[np.float64], pixels: NDArray[np.float64], is_kept: NDArray[np.bool_]
) -> Corners:
    """Kept corners (m, 2) of (n, 2), if they are arranged as on a board seen from its front.

    Raises:
        MeasurementError: too few corners, or another arrangement.
    """
    points, pixels = points[is_kept], pixels[is_kept]
    if len(points) < MIN_CORNERS:
        message = f"{len(points)} of {len(is_kept)} corners are sharp: expected {MIN_CORNERS}"
        raise MeasurementError(message)
    near = np.linalg.norm(points[:, None] - points, axis=2)
    np.fill_diagonal(near, np.inf)
    # orientation of each corner with its two nearest neighbors in different directions
    order = np.argsort(near, axis=1)
    signs = []
    for index, neighbors in enumerate(order[:, :8]):
        arms = points[neighbors] - points[index]
        crosses = arms[0, 0] * arms[:, 1] - arms[0, 1] * arms[:, 0]
        across = np.flatnonzero(np.abs(crosses) > 0.1 * np.abs(crosses).max())
        if len(across) == 0:
            continue
        other = across[0]
        seen = pixels[neighbors] - pixels[index]
        cross = seen[0, 0] * seen[other, 1] - seen[0, 1] * seen[other, 0]
        signs.append(np.sign(cross * crosses[other]))
    if not signs or min(signs) <= 0.0:
        raise MeasurementError("its corners are in no plane's order")
    return points, pixels


def _plane_residual(points: NDArray[np.float64], pixels: NDArray[np.float64]) -> float:
    """Norm of the residuals of the best affine map from points to pixels, px."""
    affine = np.column_stack((points, np.ones(len(points))))
    residuals = pixels - affine @ np.linalg.lstsq(affine, pixels, rcond=None)[0]
    return float(np.linalg.norm(residuals))


def _mirror_hint(image: NDArray[np.uint8], detect: Any, index: int) -> str:
    """Hint for the message that the image is mirrored, if its reflection shows tags; else "".

    Args:
        image: (height, width) gray image.
        detect: function of OpenCV that detects tags in an image.
        index: index of the tags' ids in the result of `detect`.
    """
    tags = detect(np.ascontiguousarray(image[:, ::-1]))[index]
    if tags is None or len(tags) < 3:
        return ""
    return "; the mirrored image shows them: give --mirrored, or do not flip the images"
