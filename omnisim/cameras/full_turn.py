"""Panoramas that repeat after a full turn."""

from __future__ import annotations

import math

from omnisim.cameras.camera import CentralCamera
from omnisim.cameras.models.cylindrical import CylindricalCamera
from omnisim.cameras.models.equirectangular import EquirectangularCamera


def period_px(camera: CentralCamera) -> float | None:
    """Period of a 360° panorama in pixels; None if the image does not wrap around."""
    if isinstance(camera, EquirectangularCamera):
        return float(camera.width_px)
    if isinstance(camera, CylindricalCamera):
        turn_px = 2.0 * math.pi * camera.focal_length_px
        return turn_px if camera.width_px >= turn_px - 1.0 else None
    return None
