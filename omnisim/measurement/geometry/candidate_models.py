"""Fits of camera models to boards, and their errors in held-out images."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Collection, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import KannalaBrandtCamera, OcamcalibCamera, UnifiedCamera
from omnisim.cameras.calibration.fit import FITTED_MODELS, fit_camera
from omnisim.cameras.calibration.linear_fit import FITTED, Bounds
from omnisim.cameras.calibration.parameter_vector import ParameterVector
from omnisim.cameras.parametric_camera import ParametricCamera
from omnisim.core.errors import CalibrationError, OpticsError
from omnisim.measurement.geometry.bundle_adjustment import Adjustment, Corners, adjust

PINHOLE = "pinhole"  # the unified model with ξ = 0: radial and tangential distortion
UNIFIED_K3 = "unified_k3"  # the unified model with a third radial term
CANDIDATES = (PINHOLE, UNIFIED_K3, *(name for name in FITTED_MODELS if name != "radial_table"))
# The boards' poses include the rotation about the optical axis; a lens is smooth at its axis.
_FIXED: Mapping[type[ParametricCamera], Collection[str]] = {
    OcamcalibCamera: ("affine.2", "polynomial.1")
}
_MARGIN_RAD = 0.01  # field of a model's initial camera beyond the outermost corner
_FOLDS = 5
_HELD_OUT_CONVERGED = 1e-6  # relative decrease of the cost; changes the RMS error by 5e-7

Floats = NDArray[np.float64]
Parameters = ParameterVector[ParametricCamera]


class Candidate(NamedTuple):
    """Camera model fitted to all images.

    Attributes:
        name: name of the model, one of `CANDIDATES`.
        parameters: free parameters of the model, with the fitted camera as their start.
        fit: fitted camera, poses and shape of the board.
    """

    name: str
    parameters: Parameters
    fit: Adjustment


def fit_candidate(
    name: str, corners: Corners, first: Adjustment, stiffness_px_per_m: float | None
) -> Candidate:
    """Fit a model, starting from a fitted Kannala-Brandt lens.

    Args:
        name: one of `CANDIDATES`.
        corners: corners in the images.
        first: fit of the Kannala-Brandt lens.
        stiffness_px_per_m: see `adjust`; None: the board's shape is not fitted.

    Raises:
        CalibrationError: the model cannot describe this lens.
    """
    camera = _first_camera(name, first, corners)
    parameters = _parameters(name, camera)
    try:
        fit = adjust(parameters, corners, first.poses, first.shape_m, stiffness_px_per_m)
    except OpticsError as reason:
        raise CalibrationError(f"camera: {name}: {reason}") from None
    return Candidate(name, _parameters(name, fit.camera), fit)


def held_out_errors(
    candidate: Candidate, corners: Corners, stiffness_px_per_m: float | None
) -> Floats:
    """Held-out errors (n, 2) of all corners in px, by fivefold cross-validation over images.

    The model is fitted without a fifth of the images; in these, only the pose of the board is
    fitted.

    Raises:
        OpticsError: a fit to the other images does not show a held-out board.
    """
    images = len(corners.starts) - 1
    errors = np.zeros_like(corners.pixels_px)
    fit = candidate.fit
    for fold in range(min(_FOLDS, images)):
        is_left_out = np.arange(images) % _FOLDS == fold
        seen, poses = select_images(corners, ~is_left_out), fit.poses[~is_left_out]
        trained = adjust(
            candidate.parameters, seen, poses, fit.shape_m, stiffness_px_per_m, _HELD_OUT_CONVERGED
        )
        still: Parameters = ParameterVector(trained.camera, {})
        left_out, poses = select_images(corners, is_left_out), fit.poses[is_left_out]
        tested = adjust(still, left_out, poses, trained.shape_m, converged=_HELD_OUT_CONVERGED)
        errors[is_left_out[corners.image]] = tested.errors_px
    return errors


def select_images(corners: Corners, chosen: NDArray[np.bool_]) -> Corners:
    """Corners in the images selected by a mask (images,)."""
    rows = chosen[corners.image]
    counts = np.diff(corners.starts)[chosen]
    image = np.repeat(np.arange(len(counts)), counts)
    starts = np.cumsum([0, *counts])
    return Corners(corners.nominal_m, corners.label[rows], corners.pixels_px[rows], image, starts)


def widest_angle_rad(fit: Adjustment, corners: Corners) -> float:
    """Largest angle between the optical axis and a corner, radians."""
    points = corners.arms_m(fit.poses, fit.shape_m) + fit.poses[corners.image, :3, 3]
    across = np.linalg.norm(points[:, :2], axis=1)
    return float(np.arctan2(across, points[:, 2]).max())


def _first_camera(name: str, first: Adjustment, corners: Corners) -> ParametricCamera:
    """Initial camera of a model, fitted to the first lens within the corners' field."""
    assert isinstance(first.camera, KannalaBrandtCamera)
    if name == KannalaBrandtCamera.model_name:
        return first.camera
    limit = min(widest_angle_rad(first, corners) + _MARGIN_RAD, math.pi)
    lens = first.camera.ending_at(min(limit, first.camera.theta_edge_rad))
    assert lens is not None
    model = UnifiedCamera if name in (PINHOLE, UNIFIED_K3) else FITTED_MODELS[name]
    fixed = {"xi": 0.0} if name == PINHOLE else {}
    camera = fit_camera(lens, model, fixed=fixed).camera
    camera = camera.ending_at(model.largest_theta_rad) or camera
    if name == UNIFIED_K3:
        assert isinstance(camera, UnifiedCamera)
        camera = dataclasses.replace(camera, distortion=(*camera.distortion[:4], 0.0))
    return camera


def _parameters(name: str, camera: ParametricCamera) -> Parameters:
    free: dict[str, Bounds] = dict(FITTED[type(camera)].free)
    if name == PINHOLE:
        free.pop("xi")
    return ParameterVector(camera, free, _FIXED.get(type(camera), ()))
