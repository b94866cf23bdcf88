"""Readers of a camera's image files, including raw files (the only importer of rawpy)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import MeasurementError, OutputError
from omnisim.core.extras import require_extra
from omnisim.core.files.image_files import read_image

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".pgm", ".ppm", ".bmp", ".webp")
RAW_SUFFIXES = (".dng", ".cr2", ".cr3", ".nef", ".arw", ".orf", ".raf", ".rw2", ".pef", ".srw")
FRAME_SUFFIX = ".npy"  # of the frames that `recorded_frames` extracts
LOSSY_FRAME_SUFFIX = ".lossy.npy"
_LOSSY = (".jpg", ".jpeg", ".webp")


def is_lossy(path: Path) -> bool:
    """True if the file's format compresses with loss, such as JPEG or a video."""
    name = path.name.lower()
    return path.suffix.lower() in _LOSSY or name.endswith(LOSSY_FRAME_SUFFIX)


def read_photo(path: Path) -> NDArray[Any]:
    """Read the stored values (height, width, channels) of an image file.

    Raw files are demosaiced to 16-bit linear RGB: the black level becomes 0, the white level 65535.
    Colors stay those of the sensor, without white balance.

    Raises:
        MeasurementError: the file is missing or damaged, or rawpy is not installed.
    """
    if path.suffix.lower() in RAW_SUFFIXES:
        return _demosaiced(path)
    if path.suffix == FRAME_SUFFIX:
        return np.load(path, allow_pickle=False)
    try:
        return read_image(path)[0]
    except OutputError as reason:
        raise MeasurementError(str(reason)) from None


def read_mosaic(path: Path) -> NDArray[Any]:
    """Read the stored values (height, width, channels) of an image; raw files keep their mosaic.

    The mosaic of a raw file has 1 channel.

    Raises:
        MeasurementError: the file is missing or damaged, or rawpy is not installed.
    """
    if path.suffix.lower() not in RAW_SUFFIXES:
        return read_photo(path)
    with _open(path) as raw:
        mosaic: NDArray[Any] = np.array(raw.raw_image_visible)
    return mosaic[..., None] if mosaic.ndim == 2 else mosaic


def _demosaiced(path: Path) -> NDArray[Any]:
    import rawpy

    with _open(path) as raw:
        try:
            rgb: NDArray[Any] = raw.postprocess(
                gamma=(1, 1),
                no_auto_bright=True,
                output_bps=16,
                output_color=rawpy.ColorSpace.raw,
                user_wb=[1.0, 1.0, 1.0, 1.0],
                adjust_maximum_thr=0.0,  # the file's white level, not the image's maximum, is white
                user_flip=0,
            )
        except rawpy.LibRawError as reason:
            raise MeasurementError(f"{path}: cannot be read: {reason}") from None
    return rgb


def _open(path: Path) -> Any:
    require_extra("raw", str(path), MeasurementError)
    import rawpy

    try:
        return rawpy.imread(str(path))
    except (rawpy.LibRawError, OSError) as reason:
        if not path.exists():
            raise MeasurementError(f"{path}: no such file") from None
        text = reason.args[0] if reason.args else reason
        shown = text.decode(errors="replace") if isinstance(text, bytes) else str(text)
        raise MeasurementError(f"{path}: cannot be read: {shown}") from None
