"""Between the optical frame and the frame of files, where every camera looks along +z.

A mirror's rays are (x, y, −z) in a file. The way back finds the mirror's own model where the
file's model, the picture and the rim's angle are enough to tell, and else a `MirroredCamera`.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

from omnisim.calibration.equivalents import equivalent, is_plain
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
from omnisim.cameras.domain import optical_axis
from omnisim.errors import OpticsError
from omnisim.mirrors import HyperbolicMirror


def theta_max_rad(camera: Any) -> float | None:
    """Angle from the axis where a camera's domain ends by its own parameters, if it has such."""
    camera = camera.lens if isinstance(camera, MirroredCamera) else camera
    mirror = getattr(camera, "mirror", None)
    limit = getattr(camera, "theta_max_rad", getattr(mirror, "theta_max_rad", None))
    return None if limit is None or limit == math.pi else float(limit)


def looks_back(camera: CentralCamera) -> bool:
    """Whether a camera looks down −z of its optical frame, as those under mirrors do."""
    return isinstance(camera, MirroredCamera) or optical_axis(camera) < 0.0


def lens_of(camera: Any) -> CentralCamera | None:
    """The lens whose rays are a camera's, or (x, y, −z) of a mirror's; None: no lens is."""
    if isinstance(camera, MirroredCamera):
        return camera.lens
    if isinstance(camera, PlanarCamera):
        size = camera.width_px, camera.height_px
        return PerspectiveCamera(*size, camera.focal_length_px, camera.principal_point_px)
    if isinstance(camera, ParabolicCamera):
        size = camera.width_px, camera.height_px
        half = 0.5 * camera.horizon_radius_px
        return StereographicCamera(*size, half, camera.principal_point_px, camera.theta_max_rad)
    if isinstance(camera, EllipticCamera):
        ratio, size = camera.half_angle_ratio, (camera.width_px, camera.height_px)
        xi = (ratio * ratio - 1.0) / (ratio * ratio + 1.0)
        gamma = camera.focal_length_px * (1.0 + xi) / ratio
        return UnifiedCamera(*size, (gamma, gamma), camera.principal_point_px, xi)
    if isinstance(camera, HyperbolicCamera):
        gamma = camera.unified_focal_length_px
        size = camera.width_px, camera.height_px
        return UnifiedCamera(*size, (gamma, gamma), camera.principal_point_px, camera.mirror.xi)
    return None if looks_back(camera) else camera


def is_turned(camera: CentralCamera) -> bool:
    """Whether a mirror's picture is upside down: its lens's rays are (−x, −y, −z) of its own."""
    return isinstance(camera, EllipticCamera)


def optical_camera(
    lens: Any, mirrored: bool, limit_rad: float | None, turned: bool = False
) -> CentralCamera:
    """The camera that a file means by a lens.

    Args:
        lens: what the file says.
        mirrored: its rays are (x, y, −z) of the camera's.
        limit_rad: angle from the axis where its domain ends, if the file says it.
        turned: and they are (−x, −y, −z), as an elliptic mirror's.
    """
    if limit_rad is not None and hasattr(lens, "theta_max_rad"):
        lens = dataclasses.replace(lens, theta_max_rad=limit_rad)
        limit_rad = None
    known = _known(lens, mirrored, limit_rad, turned)
    if known is not None:
        return known
    return MirroredCamera(lens) if mirrored else lens


def _known(
    lens: Any, mirrored: bool, limit_rad: float | None, turned: bool
) -> CentralCamera | None:
    """The model that says more than the unified one, whose parameters it has."""
    unified = equivalent(lens, UnifiedCamera)
    if not isinstance(unified, UnifiedCamera) or not is_plain(unified):
        return None
    gamma, other = unified.focal_lengths_px
    # what a rounded sum or product leaves behind is no second focal length
    if abs(gamma - other) > 4e-16 * gamma:
        return None
    size, centre = (lens.width_px, lens.height_px), lens.principal_point_px
    if limit_rad is None:
        flat = mirrored and unified.xi == 0.0
        return PlanarCamera(*size, gamma, centre) if flat else None
    try:
        if abs(unified.xi - 1.0) < 1e-15:
            if mirrored:
                return ParabolicCamera(*size, gamma, centre, limit_rad)
            return StereographicCamera(*size, 0.5 * gamma, centre, limit_rad)
        if mirrored and turned and 0.0 < unified.xi < 1.0:
            root = math.sqrt((1.0 - unified.xi) * (1.0 + unified.xi))
            eccentricity = unified.xi / (1.0 + root)
            focal = gamma / root  # γ K/(1 + ξ)
            return EllipticCamera(*size, focal, centre, eccentricity, limit_rad)
        if mirrored and unified.xi < 1.0:
            k = 1.0 + 1.0 / math.sqrt((1.0 - unified.xi) * (1.0 + unified.xi))
            mirror = HyperbolicMirror(k=k, theta_max_rad=limit_rad)
            return HyperbolicCamera(*size, gamma * (k - 1.0), centre, mirror)
    except OpticsError:  # a rim that this mirror cannot have
        return None
    return None
