"""Conversion between the optical frame and the file frame, in which cameras look along +z.

A mirror's ray (x, y, z) is (x, y, −z) in a file. Reading recovers the mirror's own model if the
lens model, the image and the rim's angle determine it, and otherwise a `MirroredCamera`.
"""

from __future__ import annotations

import math

from omnisim.cameras import (
    CentralCamera,
    EllipticCamera,
    HyperbolicCamera,
    MirroredCamera,
    ParabolicCamera,
    PerspectiveCamera,
    PlanarCamera,
    StereographicCamera,
    UnifiedCamera,
)
from omnisim.cameras.calibration.calibrated_camera import Residuals
from omnisim.cameras.calibration.equivalents import equivalent, is_plain
from omnisim.cameras.calibration.metadata import CameraMetadata
from omnisim.cameras.mirrors import HyperbolicMirror
from omnisim.cameras.models.field_of_view import optical_axis
from omnisim.cameras.parametric_camera import ParametricCamera
from omnisim.core.errors import OpticsError


def is_catadioptric(camera: CentralCamera) -> bool:
    """True for a camera that looks along −z of its optical frame, as below a mirror."""
    return isinstance(camera, MirroredCamera) or optical_axis(camera) < 0.0


def lens_of(camera: CentralCamera) -> CentralCamera | None:
    """Lens equivalent to a camera, for mirrors with z of the rays reversed; None: no such lens."""
    size, center = (camera.width_px, camera.height_px), camera.principal_point_px
    match camera:
        case MirroredCamera(lens=lens):
            return lens
        case PlanarCamera(focal_length_px=focal):
            return PerspectiveCamera(*size, focal, center)
        case ParabolicCamera(horizon_radius_px=radius, theta_max_rad=limit):
            return StereographicCamera(*size, 0.5 * radius, center, limit)
        case EllipticCamera(half_angle_ratio=ratio):
            xi = (ratio * ratio - 1.0) / (ratio * ratio + 1.0)
            gamma = camera.focal_length_px * (1.0 + xi) / ratio
            return UnifiedCamera(*size, (gamma, gamma), center, xi)
        case HyperbolicCamera(unified_focal_length_px=gamma):
            return UnifiedCamera(*size, (gamma, gamma), center, camera.mirror.xi)
    return None if is_catadioptric(camera) else camera


def camera_metadata(
    name: str, camera: CentralCamera | None, limit_rad: float | None, residuals: Residuals | None
) -> CameraMetadata:
    """Metadata of a camera that a file describes by `lens_of`, or natively (None).

    Args:
        name: camera name in the file.
        camera: camera represented by the lens in the file; None: stored natively.
        limit_rad: angle from the axis where the domain ends, or None.
        residuals: residuals of the lens in the file, if it was fitted.
    """
    return CameraMetadata(
        camera=name,
        mirrored=camera is not None and is_catadioptric(camera),
        turned=isinstance(camera, EllipticCamera),
        theta_max_rad=limit_rad,
    ).with_residuals(residuals)


def camera_from_lens(lens: CentralCamera, metadata: CameraMetadata) -> CentralCamera:
    """Camera represented by the lens in a file."""
    mirrored, limit_rad = metadata.mirrored, metadata.theta_max_rad
    if limit_rad is not None and isinstance(lens, ParametricCamera):
        ended = lens.ending_at(limit_rad)
        if ended is not None:
            lens, limit_rad = ended, None
    special = _special_camera(lens, mirrored, metadata.turned, limit_rad)
    if special is not None:
        return special
    return MirroredCamera(lens) if mirrored else lens


def _special_camera(
    lens: CentralCamera, mirrored: bool, turned: bool, limit_rad: float | None
) -> CentralCamera | None:
    """Mirror or lens model that is this special case of the unified model, or None."""
    unified = equivalent(lens, UnifiedCamera)
    if unified is None or not is_plain(unified):
        return None
    gamma, other = unified.focal_lengths_px
    # a difference of rounding size is not a second focal length
    if abs(gamma - other) > 4e-16 * gamma:
        return None
    size, center, xi = (lens.width_px, lens.height_px), lens.principal_point_px, unified.xi
    if limit_rad is None:
        return PlanarCamera(*size, gamma, center) if mirrored and xi == 0.0 else None
    try:
        if abs(xi - 1.0) < 1e-15:
            if mirrored:
                return ParabolicCamera(*size, gamma, center, limit_rad)
            return StereographicCamera(*size, 0.5 * gamma, center, limit_rad)
        root = math.sqrt(max((1.0 - xi) * (1.0 + xi), 0.0))
        if mirrored and turned and 0.0 < xi < 1.0:
            focal = gamma / root  # γ K/(1 + ξ)
            return EllipticCamera(*size, focal, center, xi / (1.0 + root), limit_rad)
        if mirrored and xi < 1.0:
            k = 1.0 + 1.0 / root
            mirror = HyperbolicMirror(k=k, theta_max_rad=limit_rad)
            return HyperbolicCamera(*size, gamma * (k - 1.0), center, mirror)
    except OpticsError:  # a rim that this mirror cannot have
        return None
    return None
