"""Quantities of a fitted camera model, with their standard deviations."""

from __future__ import annotations

import math

import numpy as np

from omnisim.cameras import FThetaInverseCamera
from omnisim.measurement.geometry.bundle_adjustment import Adjustment, Corners
from omnisim.measurement.geometry.candidate_models import Candidate, widest_angle_rad
from omnisim.measurement.quantity import Quantity, Unobservable

_EDGE_RAD = math.radians(5.0)


def model_quantities(chosen: Candidate, corners: Corners) -> tuple[Quantity, ...]:
    """Parameters of the camera with their standard deviations."""
    fit, parameters = chosen.fit, chosen.parameters
    images = len(corners.starts) - 1
    freedom = 2 * len(corners.label) - len(parameters.start) - 6 * images
    if fit.shape_m.any():
        freedom -= fit.shape_m.size
    variance = float(np.square(fit.errors_px).sum()) / max(freedom, 1)
    sigmas = fit.unit_sigmas * math.sqrt(variance) * parameters.units
    values = parameters.start * parameters.units
    basis = f"{len(corners.label)} corners in {images} images"
    return tuple(
        Quantity(label, float(value), float(sigma) or math.nan, _unit(label, chosen), basis)
        for label, value, sigma in zip(parameters.labels, values, sigmas, strict=True)
    )


def _unit(label: str, chosen: Candidate) -> str:
    name, _, index = label.partition(".")
    if name == "polynomial":
        return "px" if index == "0" else f"px^{1 - int(index)}"
    if name == "coefficients" and isinstance(chosen.fit.camera, FThetaInverseCamera):
        return f"rad/px^{int(index) + 1}"
    return "px" if name.endswith("_px") else ""


def unobservable_quantities(
    fit: Adjustment, corners: Corners, is_held_out: bool
) -> tuple[Unobservable, ...]:
    """Quantities not determined by the images: the field beyond the corners, the held-out error."""
    unobservable = []
    if not is_held_out:
        reason = (
            "without a fifth of the images, no fit reaches the corners in them: show the board in "
            "more images near the edge"
        )
        unobservable.append(Unobservable("held_out_rms_px", reason))
    reach = widest_angle_rad(fit, corners)
    camera = fit.camera
    v, u = np.mgrid[0 : camera.height_px : 8, 0 : camera.width_px : 8]
    rays = camera.ray_from_pixel(np.stack((u.ravel(), v.ravel()), axis=1).astype(np.float64))
    across = np.linalg.norm(rays.directions[rays.valid][:, :2], axis=1)
    shown = float(np.arctan2(across, rays.directions[rays.valid][:, 2]).max())
    if shown < reach + _EDGE_RAD:
        return tuple(unobservable)
    reason = (
        f"corners reach {math.degrees(reach):.1f}° from the axis, the image may reach "
        f"{math.degrees(shown):.1f}°: beyond the corners the model is extrapolated; show the board "
        "at the edge of the image"
    )
    return (*unobservable, Unobservable("field_of_view", reason))
