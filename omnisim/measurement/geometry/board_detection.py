"""Detection of calibration boards in images by OpenCV, with checks of the corners it returns.

Sources: Duda & Frese, "Accurate detection and localization of checkerboard corners for
calibration" (BMVC 2018), as `cv2.findChessboardCornersSB`; OpenCV's module `aruco`.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.ndimage import map_coordinates

from omnisim.core.arrays import Bools, Bytes, Floats, Floats32
from omnisim.core.errors import MeasurementError
from omnisim.measurement.geometry.boards import (
    AprilGrid,
    Board,
    BoardView,
    CharucoBoard,
    Chessboard,
    RejectedImage,
)
from omnisim.measurement.inputs import (
    IMAGE_SUFFIXES,
    RAW_SUFFIXES,
    is_recording,
    read_photo,
    recorded_frames,
)

MIN_CORNERS = 12  # of boards with tags, which may be seen in part
_LARGE_PX = 1000  # shorter side of images whose chessboards are searched for at half the size
_SMALL_PX = 16  # shorter side that OpenCV needs for its threshold; no board fits into less
_REACH = 1.0 / 3.0  # of the way to the next corner, whose edges would disturb
_MAX_WINDOW_PX = 9
_MIN_WINDOW_PX = 2


def find_board(
    image: Bytes, board: Board, name: str = "image", mirrored: bool = False
) -> BoardView:
    """Find a board's corners in a gray image (height, width), named in the result.

    Raises:
        MeasurementError: no board, another board, or wrong corners; without the image's name.
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


Corners = tuple[Floats, Floats]  # points (n, 2) in m, pixels (n, 2)


def _chessboard(image: Bytes, board: Chessboard) -> Corners:
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


def _chessboard_corners(image: Bytes, board: Chessboard, grid: Floats | None) -> Corners:
    """Corners of a chessboard, located from a rough grid (rows, columns, 2) or None."""
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
        # corners (rows, columns, 2) at sub-pixel accuracy, each from a third of the spacing
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
        grid = refined
        fault = grid_fault(grid) or squares_fault(image, grid) or size_fault(image, grid)
    if fault is not None:
        raise MeasurementError(fault)
    if (board.rows + board.columns) % 2 == 1 and is_first_square_white(image, grid):
        grid = grid[::-1, ::-1]  # one way round, in all images
    y, x = np.mgrid[: board.rows, : board.columns]
    points = np.stack((x.ravel(), y.ravel()), axis=1) * board.square_m
    return points, grid.reshape(-1, 2)


def _by_quadrangles(image: Bytes, size: tuple[int, int]) -> tuple[bool, Any]:
    """OpenCV's search for black quadrangles: True if all corners are found, and the corners.

    Large images are searched at half their size: the search takes seconds without a board.
    """
    import cv2

    if min(image.shape) < _SMALL_PX:
        return False, None
    if min(image.shape) < _LARGE_PX:
        return cv2.findChessboardCorners(image, size)
    is_found, corners = cv2.findChessboardCorners(cv2.pyrDown(image), size)
    return is_found, 2.0 * corners if is_found else corners


def _larger_grid(image: Bytes, size: tuple[int, int]) -> Floats | None:
    """Corners (rows, columns, 2) of a chessboard of at least `size` inner corners, or None."""
    import cv2

    flags = cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_LARGER
    is_found, corners, meta = cv2.findChessboardCornersSBWithMeta(image, size, flags)
    if not is_found:
        return None
    grid: Floats = corners.reshape(*meta.shape, 2).astype(np.float64)
    is_turned = (
        meta.shape[0] > meta.shape[1] if size[0] >= size[1] else meta.shape[0] < meta.shape[1]
    )
    return grid.swapaxes(0, 1) if is_turned else grid


def _located(image: Bytes, corners: Floats, window: int) -> Floats:
    """Saddle points (n, 2) near corners (n, 2), from windows of 2 `window` + 1 px."""
    import cv2

    stop = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 100, 1e-4)
    rough = corners.astype(np.float32).reshape(-1, 1, 2).copy()
    fine = cv2.cornerSubPix(image, rough, (window, window), (-1, -1), stop)
    return fine.reshape(-1, 2).astype(np.float64)


def _charuco(image: Bytes, board: CharucoBoard) -> Corners:
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
    distances = np.linalg.norm(rough[:, None] - rough, axis=2)
    np.fill_diagonal(distances, np.inf)
    share = 0.5 * (board.square_m - board.marker_m) / board.square_m  # of a square, beside markers
    window = _window(float(distances.min()) * min(_REACH, share))
    return _checked(points, *_kept(rough, _located(image, rough, window), window))


def _april_grid(image: Bytes, board: AprilGrid) -> Corners:
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

    def residual_px(points: Floats) -> float:  # of the best affine map to the pixels
        affine = np.column_stack((points, np.ones(len(points))))[is_kept]
        fitted = affine @ np.linalg.lstsq(affine, fine[is_kept], rcond=None)[0]
        return float(np.linalg.norm(fine[is_kept] - fitted))

    return _checked(min(turns, key=residual_px), fine, is_kept)


def _window(reach_px: float) -> int:
    """Half the side of the window for a reach, from 2 to 9 px."""
    return int(np.clip(reach_px, _MIN_WINDOW_PX, _MAX_WINDOW_PX))


def _kept(rough: Floats, fine: Floats, window: int) -> tuple[Floats, Bools]:
    """Located corners (n, 2), and a mask (n,): False if far from the corner's rough position."""
    return fine, np.linalg.norm(fine - rough, axis=1) <= max(0.5 * window, 1.0)


def _checked(points: Floats, pixels: Floats, is_kept: Bools) -> Corners:
    """Kept corners (m, 2) of (n, 2), if they are arranged as on a board seen from its front."""
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
        raise MeasurementError("its corners are not in the order of a flat board's")
    return points, pixels


def _mirror_hint(image: Bytes, detect: Any, index: int) -> str:
    """Hint that the image is mirrored, if its reflection shows tags; else "".

    `detect` is OpenCV's function, whose result has the tags' ids at `index`.
    """
    tags = detect(np.ascontiguousarray(image[:, ::-1]))[index]
    if tags is None or len(tags) < 3:
        return ""
    return "; the mirrored image shows them: give --mirrored, or do not flip the images"


# Markers of ChArUco boards and AprilGrids: OpenCV's dictionaries, detectors and bits.


TAG_BORDER_BITS = 2  # width of the black border of Kalibr's tags
_MARKER_BORDER_BITS = 1


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
    return dictionary.generateImageMarker(number, cells, borderBits=TAG_BORDER_BITS) == 0


def _printed_charuco(board: CharucoBoard) -> Any:
    import cv2

    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{board.dictionary}"))
    size = board.columns, board.rows
    return cv2.aruco.CharucoBoard(size, board.square_m, board.marker_m, dictionary)


def _tags() -> Any:
    import cv2

    return cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)


# Checks of detected corner grids: order, orientation and the colors of their squares.


MAX_STRETCH = 3.0  # of neighboring distances along a line of corners; a fisheye's edge has 1.6
MAX_BEND_COSINE = 0.6  # of neighboring steps along a line: 53°
MAX_WRONG_SQUARES = 0.05  # share; a hand, a shadow or a reflection hides some
Grid = Floats  # (rows, columns, 2) positions in the image


def cell_areas_px2(grid: Grid) -> Floats:
    """Signed areas (rows - 1, columns - 1) of a grid's cells, px²; positive: front side seen."""
    first, second = grid[1:, 1:] - grid[:-1, :-1], grid[1:, :-1] - grid[:-1, 1:]
    return 0.5 * (first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0])


def grid_fault(grid: Grid) -> str | None:
    """Fault in the order of a grid's corners, or None.

    Corners of a flat board lie on smooth lines through any lens: all cells have the same
    orientation, and neighboring steps along a line differ little in length and direction.
    """
    areas = cell_areas_px2(grid)
    if areas.min() <= 0.0 <= areas.max():
        return "its corners do not form a grid"
    for lines in (grid, grid.swapaxes(0, 1)):
        steps = np.diff(lines, axis=1)
        lengths = np.linalg.norm(steps, axis=2)
        ratios = lengths[:, 1:] / lengths[:, :-1]
        cosines = (steps[:, 1:] * steps[:, :-1]).sum(axis=2) / (lengths[:, 1:] * lengths[:, :-1])
        if max(ratios.max(), 1.0 / ratios.min()) > MAX_STRETCH or cosines.min() < MAX_BEND_COSINE:
            return "its rows of corners are irregular"
    return None


def squares_fault(image: Bytes, grid: Grid) -> str | None:
    """Fault in the colors of the squares between a chessboard's corners, or None."""
    levels = _square_levels(image, grid)
    signs = _signs(levels.shape)
    contrasts = []
    for axis in (0, 1):  # differences between neighbors: light may change across the board
        contrasts.append((np.diff(levels, axis=axis) * np.delete(signs, 0, axis=axis)).ravel())
    contrast = np.concatenate(contrasts)
    contrast *= np.sign(np.median(contrast))
    wrong = float(np.mean(contrast <= 0.0))
    if wrong > MAX_WRONG_SQUARES:
        return f"{100.0 * wrong:.0f} % of neighboring squares do not alternate in color"
    return None


def size_fault(image: Bytes, grid: Grid) -> str | None:
    """Fault if squares continue beyond a chessboard's outermost corners, or None."""
    inner = _square_levels(image, grid)
    contrast = abs(float((inner * _signs(inner.shape)).mean()))
    wider = grid
    for axis in (0, 1, 0, 1):
        first = 2.0 * np.take(wider, [0], axis) - np.take(wider, [1], axis)
        last = 2.0 * np.take(wider, [-1], axis) - np.take(wider, [-2], axis)
        wider = np.concatenate((first, wider, last), axis)
    levels = _square_levels(image, wider)
    height, width = image.shape
    is_in: Bools = np.all((wider >= 0.0) & (wider < (width, height)), axis=2)
    inside = is_in[1:, 1:] & is_in[:-1, :-1] & is_in[1:, :-1] & is_in[:-1, 1:]
    for side in (np.s_[0, 2:-2], np.s_[-1, 2:-2], np.s_[2:-2, 0], np.s_[2:-2, -1]):
        steps = np.diff(levels[side]) * _signs((levels[side].size - 1,))
        if inside[side].all() and abs(float(steps.mean())) > contrast:  # half of a step's size
            return "its squares continue beyond the board: expected more corners"
    return None


def is_first_square_white(image: Bytes, grid: Grid) -> bool:
    """True if the square between a grid's first corners is white."""
    levels = _square_levels(image, grid)
    signs = _signs(levels.shape)
    return bool((levels * signs).sum() / signs.size > np.mean(levels) * signs.mean())


def _square_levels(image: Bytes, grid: Grid) -> Floats32:
    """Gray levels (rows - 1, columns - 1) in the middle of a grid's squares."""
    centers = 0.25 * (grid[1:, 1:] + grid[:-1, :-1] + grid[1:, :-1] + grid[:-1, 1:])
    positions = np.moveaxis(centers[..., ::-1], -1, 0)
    return map_coordinates(image.astype(np.float32), positions, order=1, mode="nearest")


def _signs(shape: tuple[int, ...]) -> Floats:
    """1 and -1 alternately, as the squares of a chessboard of shape (rows, columns)."""
    return 1.0 - 2.0 * (np.indices(shape).sum(axis=0) % 2)


# Search for boards in image files, in parallel on all cores.


LUMA = np.array([0.299, 0.587, 0.114])  # weights of R, G and B
_LOW, _HIGH = 0.5, 99.8  # percentiles of 16-bit images that map to black and white


class BoardSearch(NamedTuple):
    """Board in one image: its corners or the rejected image, and the image's width and height."""

    found: BoardView | RejectedImage
    size_px: tuple[int, int]


def image_files(folder: Path) -> list[Path]:
    """Image files of a folder, sorted by name; or frames of a video or of a ROS bag.

    Raises:
        MeasurementError: a missing folder, a folder without images, or a recording that cannot be
            read.
    """
    if is_recording(folder):
        return recorded_frames(folder)
    if not folder.is_dir():
        raise MeasurementError(f"{folder}: expected a folder of images, a video or a ROS bag")
    suffixes = IMAGE_SUFFIXES + RAW_SUFFIXES
    files = [path for path in sorted(folder.iterdir()) if path.suffix.lower() in suffixes]
    if not files:
        raise MeasurementError(f"{folder}: expected images ({' '.join(IMAGE_SUFFIXES)}), got none")
    return files


def find_boards(
    files: Sequence[Path], board: Board, mirrored: bool = False
) -> Iterator[BoardSearch]:
    """Search for a board in images; yields results in the order of the files.

    Raises:
        MeasurementError: a file that cannot be read, or images of several sizes.
    """
    first: tuple[int, int] | None = None

    def search(path: Path) -> BoardSearch:
        image = read_gray(path)
        try:
            found: BoardView | RejectedImage = find_board(image, board, path.name, mirrored)
        except MeasurementError as reason:
            found = RejectedImage(path.name, str(reason))
        return BoardSearch(found, (image.shape[1], image.shape[0]))

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for path, result in zip(files, pool.map(search, files), strict=True):
            first = result.size_px if first is None else first
            if result.size_px != first:
                pool.shutdown(wait=False, cancel_futures=True)
                seen, wanted = (f"{size[0]} × {size[1]} px" for size in (result.size_px, first))
                raise MeasurementError(
                    f"{path}: {seen}, but {files[0].name} has {wanted}: "
                    "expected images of one camera"
                )
            yield result


def read_gray(path: Path) -> Bytes:
    """Gray image (height, width), with 16 bits stretched to 8.

    Raises:
        MeasurementError: the file is missing or damaged, or is not an image of 8 or 16 bits.
    """
    pixels = read_photo(path)
    if pixels.dtype not in (np.uint8, np.uint16):
        raise MeasurementError(f"{path}: expected 8 or 16 bits, got {pixels.dtype}")
    gray = pixels[..., 0] if pixels.shape[2] < 3 else pixels[..., :3] @ LUMA
    if pixels.dtype == np.uint16:
        low, high = np.percentile(gray, (_LOW, _HIGH))
        gray = (gray - low) * (255.0 / max(high - low, 1.0))
    return np.clip(np.rint(gray), 0, 255).astype(np.uint8)
