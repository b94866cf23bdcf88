"""Images of edges as linear light."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import MeasurementError
from omnisim.measurement.inputs import (
    RAW_SUFFIXES,
    is_lossy,
    is_recording,
    read_photo,
    recorded_frames,
)
from omnisim.rendering.camera.degradations.encoding import Encoding

SUFFIXES = (".png", ".tif", ".tiff", ".pgm", ".exr")
LOSSY = (".jpg", ".jpeg")
MIN_BITS = 8


def find_edge_images(path: Path) -> list[Path]:
    """Image files in a folder, sorted by name; frames of a video or bag; or the file itself.

    Raises:
        MeasurementError: no images, or files of other formats.
    """
    if is_recording(path):
        return recorded_frames(path)
    files = [path] if path.is_file() else []
    if path.is_dir():
        files = [file for file in sorted(path.iterdir()) if not file.name.startswith(".")]
    expected = " ".join(SUFFIXES + LOSSY)
    if not files:
        raise MeasurementError(f"{path}: expected images ({expected}), got none")
    for file in files:
        if file.suffix.lower() not in SUFFIXES + LOSSY + RAW_SUFFIXES:
            raise MeasurementError(f"{file}: expected images ({expected}) only")
    return files


def read_edge_image(path: Path, encoding: Encoding | None) -> NDArray[Any]:
    """Stored values (height, width, 1 or 3) of an image.

    Args:
        path: image file.
        encoding: encoding of the values; None: linear.

    Raises:
        MeasurementError: the file is damaged, or is a JPEG or a video of unknown encoding.
    """
    if is_lossy(path) and encoding is None:
        kind = "JPEG" if path.suffix.lower() in LOSSY else "a video's"
        raise MeasurementError(
            f"{path}: {kind} values are not linear: save raw frames as PNG or TIFF, or give the "
            "camera's response, such as srgb"
        )
    pixels = read_photo(path)
    if pixels.shape[2] in (2, 4):  # transparency
        pixels = pixels[..., :-1]
    return pixels


def linear_light(
    pixels: NDArray[Any], encoding: Encoding | None, name: str
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Linear light (height, width, 1 or 3) of stored values, and a mask of clipped pixels.

    White is 1 for floats, and the largest value of the converter's bits for integers.

    Args:
        pixels: (height, width) or (height, width, channels) values.
        encoding: encoding of the values; None: linear.
        name: file name in messages.

    Raises:
        MeasurementError: not one or three channels, or values that are not finite.
    """
    values = pixels[..., None] if pixels.ndim == 2 else pixels
    if values.ndim != 3 or values.shape[2] not in (1, 3):
        raise MeasurementError(f"{name}: expected one or three channels, got {pixels.shape}")
    if np.issubdtype(values.dtype, np.integer):
        largest = _largest(values)
        clipped = np.any((values >= largest) | (values <= 0), axis=2)
        values = values / largest
    elif np.isfinite(values).all():
        clipped = np.zeros(values.shape[:2], dtype=bool)
    else:
        raise MeasurementError(f"{name}: expected finite values")
    light = values.astype(np.float64)
    if encoding is not None:
        light = encoding.linearized(np.maximum(light, 0.0))
    return light, clipped


def _largest(values: NDArray[Any]) -> int:
    """Largest value of the converter; its bits may be the upper or the lower ones of 16."""
    used = int(np.bitwise_or.reduce(values, axis=None))
    shift = (used & -used).bit_length() - 1 if used else 0
    bits = max((used >> shift).bit_length(), MIN_BITS if shift == 0 else 1)
    return ((1 << bits) - 1) << shift
