"""Optical flow in two common formats: Middlebury's .flo and KITTI's PNG."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import OutputError
from omnisim.core.files.atomic_file import atomic_write
from omnisim.core.files.image_files import write_numbers

_FLO_MAGIC = np.float32(202021.25)  # "PIEH"
_FLO_UNKNOWN, _FLO_LARGEST = np.float32(1e10), 1e9
KITTI_STEPS_PER_PX, _KITTI_ZERO = 64.0, 2**15


def write_flo(path: Path, flow_px: NDArray[np.float32]) -> None:
    """Write flow (height, width, 2) in Middlebury's format, with 1e10 in place of NaN.

    Source: Baker et al., "A database and evaluation methodology for optical flow", flow-code.

    Raises:
        OutputError: the file cannot be written.
    """
    height, width = flow_px.shape[:2]
    known = np.where(np.isnan(flow_px), _FLO_UNKNOWN, flow_px).astype("<f4")
    with atomic_write(path) as partial:
        partial.write_bytes(
            _FLO_MAGIC.astype("<f4").tobytes()
            + np.array([width, height], dtype="<i4").tobytes()
            + known.tobytes()
        )


def read_flo(path: Path) -> NDArray[np.float32]:
    """Read flow (height, width, 2) from Middlebury's format, with NaN for unknown flow.

    Raises:
        OutputError: the file cannot be read, or has another format.
    """
    try:
        data = path.read_bytes()
    except OSError as reason:
        raise OutputError(f"{path}: cannot be read: {reason.strerror}") from None
    width, height = np.frombuffer(data[4:12], "<i4").tolist() if len(data) >= 12 else (0, 0)
    is_flo = data[:4] == _FLO_MAGIC.astype("<f4").tobytes() and min(width, height) > 0
    if not is_flo or len(data) != 12 + 8 * width * height:
        raise OutputError(f"{path}: expected optical flow in Middlebury's format")
    flow_px = np.frombuffer(data[12:], "<f4").reshape(height, width, 2).astype(np.float32)
    flow_px[flow_px > _FLO_LARGEST] = np.nan
    return flow_px


def write_kitti_flow(path: Path, flow_px: NDArray[np.float32]) -> None:
    """Write flow (height, width, 2) as 16-bit RGB: 64 u + 2^15, 64 v + 2^15, and 1 if valid.

    Flow that is NaN or beyond ±512 px is invalid: 0, 0, 0. Occluded points are included, as in
    KITTI's flow_occ.

    Source: KITTI, devkit of the flow benchmark 2015, readme.

    Raises:
        OutputError: the file cannot be written.
    """
    known: NDArray[np.bool_] = np.all(~np.isnan(flow_px), axis=-1)
    steps = np.rint(KITTI_STEPS_PER_PX * np.where(known[..., None], flow_px, 0.0)) + _KITTI_ZERO
    known &= np.all((steps >= 0) & (steps < 2**16), axis=-1)
    pixels = np.zeros((*known.shape, 3), dtype=np.uint16)
    pixels[known, :2] = steps[known]
    pixels[known, 2] = 1
    write_numbers(path, pixels)
