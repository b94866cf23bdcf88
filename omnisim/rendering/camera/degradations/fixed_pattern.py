"""Fixed pattern of a sensor: each pixel's own gain and dark signal, equal in all images.

Source: EMVA Standard 1288, release 4.0: photo-response and dark-signal nonuniformity (PRNU, DSNU).
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np

from omnisim.core.arrays import Floats32
from omnisim.core.errors import OutputError, SensorFileError
from omnisim.core.random_numbers import key_of, normal, pcg4d

GAIN, OFFSET = "prnu", "dsnu_e"  # channels of a pattern's file


def no_pattern() -> Floats32:
    """Pattern (1, 1, 2) of a uniform sensor."""
    return np.zeros((1, 1, 2), dtype=np.float32)


def random_pattern(
    width_px: int, height_px: int, prnu: float, dsnu_e: float, seed: int
) -> Floats32:
    """Normally distributed pattern without rows or columns.

    Args:
        prnu: standard deviation of the pixels' gains, as a share of the mean gain.
        dsnu_e: standard deviation of the pixels' dark signals, electrons.
        seed: seed of the pattern.

    Returns:
        (height, width, 2): deviation of the gain as a share, and of the dark signal in electrons.
    """
    column, row = np.meshgrid(np.arange(width_px), np.arange(height_px))
    hashes = pcg4d(column, row, 0, key_of("fixed pattern", seed))
    deviations = normal(hashes[0], hashes[1]), normal(hashes[2], hashes[3])
    sigmas = np.array((prnu, dsnu_e), dtype=np.float32)
    return np.stack(deviations, axis=-1) * sigmas


def write_pattern(path: Path, pattern: Floats32) -> None:
    """Write a pattern (height, width, 2) as an EXR file with the channels `prnu` and `dsnu_e`.

    Raises:
        OutputError: the file cannot be written.
    """
    from omnisim.core.files.image_files import write_channels  # slow to import

    write_channels(path, {GAIN: pattern[..., 0], OFFSET: pattern[..., 1]})


def read_pattern(path: Path) -> Floats32:
    """Pattern (height, width, 2) of a file, see `write_pattern`.

    Raises:
        SensorFileError: the file is damaged, or has other channels or numbers than expected.
    """
    try:
        changed_ns = path.stat().st_mtime_ns
    except OSError as reason:
        raise SensorFileError(f"{path}: cannot be read: {reason.strerror}") from None
    return _read(path, changed_ns)


@lru_cache(maxsize=2)  # the reference reads it for each image
def _read(path: Path, changed_ns: int) -> Floats32:
    from omnisim.core.files.image_files import read_channels  # slow to import

    try:
        channels = read_channels(path).values
    except OutputError as reason:
        raise SensorFileError(str(reason)) from None
    if sorted(channels) != sorted((GAIN, OFFSET)):
        expected = f"expected the channels {GAIN} and {OFFSET}"
        raise SensorFileError(f"{path}: {expected}, got {', '.join(sorted(channels))}")
    pattern = np.stack((channels[GAIN], channels[OFFSET]), axis=-1)
    if not np.isfinite(pattern).all() or (pattern[..., 0] < -1.0).any():
        raise SensorFileError(f"{path}: expected finite numbers, and {GAIN} of at least -1")
    pattern.setflags(write=False)
    return pattern


def resampled(pattern: Floats32, width_px: int, height_px: int) -> Floats32:
    """Pattern (height, width, 2) of an image of another size: that of the nearest pixels.

    Neighbors are not averaged, which would make the pattern weaker.
    """
    height, width = pattern.shape[:2]
    if (height, width) == (height_px, width_px):
        return pattern
    rows = (2 * np.arange(height_px) + 1) * height // (2 * height_px)
    columns = (2 * np.arange(width_px) + 1) * width // (2 * width_px)
    return pattern[rows[:, None], columns]
