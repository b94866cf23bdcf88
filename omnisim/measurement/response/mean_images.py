"""Mean of images of a static scene."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import MeasurementError
from omnisim.measurement.inputs import read_photo

MAX_CLIPPED = 0.01  # share of a flat field's values


def mean_image(files: Sequence[Path], channel: int) -> tuple[NDArray[np.float64], float]:
    """Mean (height, width) of a channel of images, and the largest possible value.

    Args:
        files: image files of one size.
        channel: index of the channel; ignored for gray images.

    Raises:
        MeasurementError: no files, a file that cannot be read, a bit depth other than 8 or 16, or
            images of several sizes or bit depths.
    """
    if not files:
        raise MeasurementError("expected images, got none")
    total: NDArray[np.float64] | None = None
    largest = 0.0
    for path in files:
        pixels = read_photo(path)
        if pixels.dtype not in (np.uint8, np.uint16):
            raise MeasurementError(f"{path}: expected 8 or 16 bits, got {pixels.dtype}")
        plane = pixels[..., min(channel, pixels.shape[2] - 1)].astype(np.float64)
        highest = 255.0 if pixels.dtype == np.uint8 else 65535.0
        if total is not None and (total.shape != plane.shape or highest != largest):
            raise MeasurementError(
                f"{path}: {plane.shape[1]} × {plane.shape[0]} px, white is {highest:g}, but "
                f"{files[0].name} has {total.shape[1]} × {total.shape[0]} px, white is "
                f"{largest:g}: expected the images of one camera"
            )
        total, largest = plane if total is None else total + plane, highest
    assert total is not None
    return total / len(files), largest


def check_unclipped(flat: NDArray[np.float64], largest: float, name: str) -> None:
    """Reject a flat field with too many white pixels.

    Args:
        flat: (height, width) mean of the images.
        largest: level of white.
        name: name of the images, for messages.

    Raises:
        MeasurementError: more than 1 % of the pixels are white.
    """
    clipped = float(np.mean(flat >= 0.995 * largest))
    if clipped > MAX_CLIPPED:
        raise MeasurementError(
            f"{name}: {100.0 * clipped:.0f} % of the pixels are white: expected a shorter exposure"
        )
