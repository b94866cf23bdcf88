"""Views to unwarp an omnidirectional image to: cylinder, perspective, bird's eye.

Each view is a camera at the effective viewpoint of the image, with an orientation on the vehicle.
The bird's eye view is a perspective view straight down, in which plane ground appears as a map.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from omnisim.cameras import CentralCamera, CylindricalCamera, PerspectiveCamera
from omnisim.core.arrays import Floats
from omnisim.core.coordinate_frames import (
    BASE_FROM_OPTICAL_LOOKING_AHEAD,
    BASE_FROM_OPTICAL_LOOKING_DOWN,
)
from omnisim.core.errors import OpticsError
from omnisim.core.poses import rotation_from_roll_pitch_yaw

STEEPEST_RAD = math.radians(85.0)  # of a cylinder's rows: at 90° they are infinitely far away


@dataclass(frozen=True, eq=False)
class View:
    """Camera at the effective viewpoint, and its (3, 3) rotation to the vehicle's base."""

    camera: CentralCamera
    base_from_view: Floats


def cylinder_view(
    width_px: int, lowest_rad: float, highest_rad: float, yaw_rad: float = 0.0
) -> View:
    """Cylindrical view of a whole turn of `width_px`, left to right clockwise.

    The middle column looks toward `yaw_rad`, counter-clockwise from the vehicle's front, the left
    and right edges back; elevations are of the lowest and highest row above the horizon.

    Raises:
        OpticsError: elevations that leave no row between them, or are too steep for a cylinder.
    """
    if not -STEEPEST_RAD <= lowest_rad < highest_rad <= STEEPEST_RAD:
        raise OpticsError(
            f"cylinder: elevation {math.degrees(lowest_rad):g}° to {math.degrees(highest_rad):g}°: "
            f"expected the lower one first, within ±{math.degrees(STEEPEST_RAD):g}°"
        )
    focal_length_px = width_px / (2.0 * math.pi)
    top_px = focal_length_px * math.tan(highest_rad)
    height_px = max(1, round(top_px - focal_length_px * math.tan(lowest_rad)))
    center = (0.5 * (width_px - 1), top_px - 0.5)
    camera = CylindricalCamera(width_px, height_px, focal_length_px, center)
    return View(camera, _turned(yaw_rad) @ BASE_FROM_OPTICAL_LOOKING_AHEAD)


def perspective_view(
    width_px: int,
    height_px: int,
    field_of_view_rad: float,
    yaw_rad: float = 0.0,
    pitch_rad: float = 0.0,
) -> View:
    """Perspective view of a pinhole camera, with its field of view between the left and right edge.

    Yaw is counter-clockwise from the vehicle's front, pitch positive downward as in REP 103.

    Raises:
        OpticsError: a field of view that is not between 0 and 180°, or a size below 1.
    """
    camera = PerspectiveCamera.with_field_of_view(width_px, height_px, field_of_view_rad)
    return View(camera, _turned(yaw_rad, pitch_rad) @ BASE_FROM_OPTICAL_LOOKING_AHEAD)


def birdseye_view(
    size_px: int, half_extent_m: float, height_m: float, yaw_rad: float = 0.0
) -> View:
    """Bird's eye view: a square map of the ground, the vehicle in the middle, its front up.

    `half_extent_m` is from the middle to an edge; the effective viewpoint is `height_m` above the
    ground; the top of the map heads `yaw_rad` counter-clockwise from the vehicle's front.

    Raises:
        OpticsError: an extent, height or size that is not above 0.
    """
    for name, value in (("height", height_m), ("extent", half_extent_m)):
        if not (math.isfinite(value) and value > 0.0):
            raise OpticsError(
                f"bird's eye: {name}: expected a finite number of meters above 0, got {value:g}"
            )
    focal_length_px = 0.5 * size_px * height_m / half_extent_m
    middle = 0.5 * (size_px - 1)
    camera = PerspectiveCamera(size_px, size_px, focal_length_px, (middle, middle))
    return View(camera, _turned(yaw_rad) @ BASE_FROM_OPTICAL_LOOKING_DOWN)


def highest_elevation_deg(camera: CentralCamera, base_from_optical: Floats) -> float:
    """Highest whole degree of elevation, up to 60, visible at all azimuths.

    If there is none, as of a lens that looks ahead, the highest one visible anywhere; else 0.

    `base_from_optical` is the (3, 3) rotation of the camera, level or tilted.
    """
    azimuth = np.radians(np.arange(0.0, 360.0, 5.0))
    highest_deg = 0.0
    for elevation_deg in range(60, -60, -1):
        elevation = math.radians(elevation_deg)
        x, y = math.cos(elevation) * np.cos(azimuth), math.cos(elevation) * np.sin(azimuth)
        base = np.stack((x, y, np.full_like(azimuth, math.sin(elevation))), axis=-1)
        pixels = camera.pixel_from_ray(base @ base_from_optical)
        last = camera.width_px - 1, camera.height_px - 1
        inside = (pixels.positions_px >= 0.0) & (pixels.positions_px <= last)
        seen = pixels.valid & inside.all(axis=-1)
        if seen.all():
            return float(elevation_deg)
        if seen.any():
            highest_deg = max(highest_deg, float(elevation_deg))
    return highest_deg


def _turned(yaw_rad: float, pitch_rad: float = 0.0) -> Floats:
    if not (math.isfinite(yaw_rad) and math.isfinite(pitch_rad)):
        yaw_deg, pitch_deg = math.degrees(yaw_rad), math.degrees(pitch_rad)
        raise OpticsError(
            "view: yaw and pitch: expected finite numbers of degrees, "
            f"got {yaw_deg:g} and {pitch_deg:g}"
        )
    return rotation_from_roll_pitch_yaw(0.0, pitch_rad, yaw_rad)
