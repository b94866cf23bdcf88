"""Search for boards in image files, in parallel on all cores."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import MeasurementError
from omnisim.measurement.geometry.board_detection import find_board
from omnisim.measurement.geometry.board_view import BoardView, RejectedImage
from omnisim.measurement.geometry.boards import Board
from omnisim.measurement.inputs import (
    IMAGE_SUFFIXES,
    RAW_SUFFIXES,
    is_recording,
    read_photo,
    recorded_frames,
)

LUMA = np.array([0.299, 0.587, 0.114])  # weights of R, G and B
_LOW, _HIGH = 0.5, 99.8  # percentiles of 16-bit images that map to black and white


class BoardSearch(NamedTuple):
    """Result of the search for a board in one image.

    Attributes:
        found: corners of the board, or the rejected image with the reason.
        size_px: width and height of the image.
    """

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

    Args:
        files: image files.
        board: board to search for.
        mirrored: True if the camera looks into a mirror.

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
                seen, wanted = (
                    f"{width} × {height} px" for width, height in (result.size_px, first)
                )
                raise MeasurementError(
                    f"{path}: {seen}, but {files[0].name} has {wanted}: "
                    "expected images of one camera"
                )
            yield result


def read_gray(path: Path) -> NDArray[np.uint8]:
    """Gray image (height, width), with 16 bits stretched to 8.

    Raises:
        MeasurementError: the file is missing or damaged, or is not an image of 8 or 16 bits.
    """
    return _as_gray(read_photo(path), path)


def _as_gray(pixels: NDArray[Any], path: Path) -> NDArray[np.uint8]:
    if pixels.dtype not in (np.uint8, np.uint16):
        raise MeasurementError(f"{path}: expected 8 or 16 bits, got {pixels.dtype}")
    gray = pixels[..., 0] if pixels.shape[2] < 3 else pixels[..., :3] @ LUMA
    if pixels.dtype == np.uint16:
        low, high = np.percentile(gray, (_LOW, _HIGH))
        gray = (gray - low) * (255.0 / max(high - low, 1.0))
    levels: NDArray[np.uint8] = np.clip(np.rint(gray), 0, 255).astype(np.uint8)
    return levels
