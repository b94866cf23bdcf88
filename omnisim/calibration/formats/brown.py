"""Coefficients of Brown's distortion as OpenCV orders them, as the lens that they mean."""

from __future__ import annotations

from collections.abc import Sequence

from omnisim.calibration.distorted_pinhole import BrownLens, nearest_lens
from omnisim.calibration.formats.pinholes import pinhole
from omnisim.cameras import CentralCamera
from omnisim.errors import CalibrationError

COUNTS = (0, 4, 5, 8, 12, 14)
NAMES = ["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4", "τx", "τy"]


def brown_pinhole(
    size_px: tuple[int, int],
    focal_lengths_px: tuple[float, float],
    principal_point_px: tuple[float, float],
    coefficients: Sequence[float],
    source: str,
) -> tuple[CentralCamera, tuple[str, ...]]:
    """The lens, and notes where no model of ours is it.

    Args:
        size_px, focal_lengths_px, principal_point_px: of the picture.
        coefficients: as many as OpenCV has; thin prisms and tilts have to be 0.
        source: names file and key in messages.

    Raises:
        CalibrationError: another number of coefficients, or a lens that cannot be said.
    """
    if len(coefficients) not in COUNTS:
        raise CalibrationError(
            f"{source}: {len(coefficients)} numbers: want k1, k2, p1, p2, k3 and perhaps k4, k5, k6"
        )
    for name, value in zip(NAMES[8:], coefficients[8:], strict=False):
        if value:
            raise CalibrationError(f"{source}: {name} = {value:g}: want 0: omnisim has no such")
    used = [float(value) for value in coefficients[:8]]
    used += [0.0] * (8 - len(used))
    if not any(used[5:]):
        known = used[:5] if used[4] else used[:4]
        return pinhole(size_px, focal_lengths_px, principal_point_px, known), ()
    lens = BrownLens(*size_px, focal_lengths_px, principal_point_px, tuple(used))
    return nearest_lens(lens, source)
