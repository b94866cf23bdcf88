"""Folders of dark frames and flat fields, by exposure.

A folder `dark` and a folder `flat`, each with a folder per exposure that is named by its time:

    dark/1ms/*.png    flat/1ms/*.png    flat/2.5ms/*.png    flat/0.01s-bright/*.png
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import MeasurementError
from omnisim.measurement.inputs import RAW_SUFFIXES, is_lossy, read_mosaic
from omnisim.measurement.noise.frame_statistics import FrameStatistics, frame_statistics

SUFFIXES = (".png", ".tif", ".tiff", ".pgm")
_UNITS_S = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6}
_EXPOSURE = re.compile(r"(\d+(?:\.\d+)?)\s*(s|ms|us|µs)(?:[-_ ].*)?")


@dataclass(frozen=True)
class FrameSet:
    """Frames of one exposure.

    Attributes:
        folder: folder of the frames.
        exposure_s: exposure time.
        files: image files, sorted by name.
    """

    folder: Path
    exposure_s: float
    files: tuple[Path, ...]


def find_frame_sets(folder: Path, is_lossy_allowed: bool = False) -> list[FrameSet]:
    """Find the frames of a folder with one folder per exposure, such as `2.5ms` or `1ms-bright`.

    Args:
        folder: folder with one folder per exposure.
        is_lossy_allowed: accept JPEG and WebP, which preserve mean values but not noise.

    Raises:
        MeasurementError: the folder is missing or empty, a folder is not named by an exposure
            time, or a file is lossy or of an unknown format.
    """
    if not folder.is_dir():
        raise MeasurementError(f"{folder}: expected a folder with one folder per exposure")
    sets = [
        _frame_set(path, is_lossy_allowed) for path in sorted(folder.iterdir()) if path.is_dir()
    ]
    if not sets:
        raise MeasurementError(f"{folder}: expected folders such as 1ms and 2.5ms, got none")
    return sorted(sets, key=lambda one: one.exposure_s)


def _frame_set(folder: Path, is_lossy_allowed: bool) -> FrameSet:
    match = _EXPOSURE.fullmatch(folder.name)
    if match is None:
        raise MeasurementError(f"{folder}: expected an exposure time as name, such as 2.5ms")
    files = tuple(path for path in sorted(folder.iterdir()) if not path.name.startswith("."))
    for path in files:
        if is_lossy(path) and not is_lossy_allowed:
            raise MeasurementError(f"{path}: lossy compression changes the noise: save PNG or TIFF")
        if not is_lossy(path) and path.suffix.lower() not in SUFFIXES + RAW_SUFFIXES:
            expected = " ".join(SUFFIXES)
            raise MeasurementError(f"{path}: expected images ({expected}) only")
    return FrameSet(folder, float(match[1]) * _UNITS_S[match[2]], files)


def read_statistics(frames: FrameSet) -> FrameStatistics:
    """Statistics of the frames of one exposure.

    Raises:
        MeasurementError: a damaged file, a file that is not a raw image of one channel and 8 or 16
            bits, too few frames, or frames of several sizes.
    """
    return frame_statistics(_read(frames), frames.exposure_s, str(frames.folder))


def _read(frames: FrameSet) -> Iterator[NDArray[Any]]:
    for path in frames.files:
        pixels = read_mosaic(path)
        if pixels.dtype not in (np.uint8, np.uint16):
            raise MeasurementError(f"{path}: expected 8 or 16 bits, got {pixels.dtype}")
        if pixels.shape[2] != 1:
            raise MeasurementError(
                f"{path}: expected raw frames of one channel, got {pixels.shape[2]}: "
                "demosaicing mixes the noise of pixels"
            )
        yield pixels[..., 0]
