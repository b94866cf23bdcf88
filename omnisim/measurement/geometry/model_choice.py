"""Choice of a camera model by its errors in held-out images."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from omnisim.cameras import FThetaInverseCamera, KannalaBrandtCamera, OcamcalibCamera, UnifiedCamera
from omnisim.cameras.calibration.fit import FITTED_MODELS, fit_camera
from omnisim.cameras.calibration.linear_fit import FITTED, Bounds, ParameterVector
from omnisim.cameras.parametric_camera import ParametricCamera
from omnisim.core.arrays import Bools, Floats
from omnisim.core.errors import CalibrationError, MeasurementError, OpticsError
from omnisim.measurement import Quantity, Unobservable
from omnisim.measurement.geometry.bundle_adjustment import Adjustment, Corners, adjust, rms_px

MAX_COMPARED = 40  # images for the comparison of models; the chosen model is fitted to all
MAX_MODEL_SIGMA = 0.2  # relative sigma of a focal length that correlates with another, as with ξ
MAX_EXCESS = 0.02  # accepted relative excess of squared held-out errors, for fewer parameters
_MAX_ERROR_RATIO = 1.5  # factor of the smallest error of all models; models beyond it are dropped


@dataclass(frozen=True)
class ModelResult:
    """Errors of a camera model fitted to the corners."""

    name: str  # name of the model
    parameters: int  # number of free parameters; 0: the model could not be fitted
    rms_px: float  # root mean square distance of the corners from their predictions; NaN: no fit
    # the same in held-out images; NaN: not measured, since the model does not fit or does not show
    # all corners. Models other than the chosen one are fitted to at most `MAX_COMPARED` images.
    held_out_rms_px: float
    reason: str = ""  # reason for rejecting the model; "": not rejected


@dataclass(frozen=True, eq=False)
class ModelChoice:
    """Camera model chosen by its errors in held-out images."""

    chosen: Candidate  # chosen model, fitted to all images
    # its root mean square error in held-out images; NaN: no fit shows all their corners
    held_out_rms_px: float
    models: tuple[ModelResult, ...]  # results of all models, the best on held-out images first


def choose_model(
    models: Sequence[str], corners: Corners, first: Adjustment, stiffness: float | None
) -> ModelChoice:
    """Fit models, and choose the one that predicts held-out images with the fewest parameters.

    At most `MAX_COMPARED` images choose the model, which is then fitted to all.

    Args:
        models: names of the models to try.
        corners, first: corners in the images, and the Kannala-Brandt lens fitted to them.
        stiffness: stiffness of the board in px/m, see `adjust`; None: its shape is not fitted.

    Raises:
        MeasurementError: no model fits the lens.
    """
    part, start = _subset(corners, first)
    candidates, results = [], []
    for name in models:
        try:
            candidate = fit_candidate(name, part, start, stiffness)
            # the corners must determine the focal lengths separately
            values, fit = candidate.parameters.start, candidate.fit
            sigmas = fit.unit_sigmas * fit.rms_px
            for label, value, sigma in zip(
                candidate.parameters.labels, values, sigmas, strict=True
            ):
                if label.startswith("focal_length") and sigma > MAX_MODEL_SIGMA * value:
                    numbers = f"{label} = {value:.4g} ± {sigma:.2g} px"
                    raise CalibrationError(f"camera: {name}: not determined: {numbers}")
            candidates.append(candidate)
        except (CalibrationError, OpticsError) as reason:
            results.append(ModelResult(name, 0, math.nan, math.nan, str(reason)))
    if not candidates:
        reasons = "; ".join(f"{result.name}: {result.reason}" for result in results)
        raise MeasurementError(f"no model describes the lens: {reasons}")
    limit = _MAX_ERROR_RATIO * min(candidate.fit.rms_px for candidate in candidates)
    near = [candidate for candidate in candidates if candidate.fit.rms_px <= limit]
    errors = {candidate.name: _held_out(candidate, part, stiffness) for candidate in near}
    known = {name: error for name, error in errors.items() if error is not None}
    if known:
        chosen = _chosen(
            [candidate for candidate in candidates if candidate.name in known], known, part
        )
    else:
        chosen = min(candidates, key=lambda candidate: candidate.fit.rms_px)
    if part is not corners:
        try:
            chosen = fit_candidate(chosen.name, corners, first, stiffness)
        except (CalibrationError, OpticsError) as reason:
            raise MeasurementError(f"{reason}, in all images") from None
        candidates = [
            chosen if candidate.name == chosen.name else candidate for candidate in candidates
        ]
        known.pop(chosen.name, None)
        held_out = _held_out(chosen, corners, stiffness)
        if held_out is not None:
            known[chosen.name] = held_out
    held_out_rms = {name: rms_px(error) for name, error in known.items()}
    for candidate in candidates:
        rms = held_out_rms.get(candidate.name, math.nan)
        results.append(
            ModelResult(candidate.name, len(candidate.parameters.start), candidate.fit.rms_px, rms)
        )
    results.sort(
        key=lambda result: (
            math.isnan(result.held_out_rms_px),
            result.held_out_rms_px,
            result.rms_px,
        )
    )
    return ModelChoice(chosen, held_out_rms.get(chosen.name, math.nan), tuple(results))


def _subset(corners: Corners, first: Adjustment) -> tuple[Corners, Adjustment]:
    """Corners in at most `MAX_COMPARED` images, and the same images' part of the first fit."""
    images = len(corners.starts) - 1
    if images <= MAX_COMPARED:
        return corners, first
    is_used = np.zeros(images, dtype=bool)
    is_used[np.linspace(0, images - 1, MAX_COMPARED).round().astype(np.int64)] = True
    rows = is_used[corners.image]
    part = first._replace(poses=first.poses[is_used], errors_px=first.errors_px[rows])
    return select_images(corners, is_used), part


def _held_out(candidate: Candidate, corners: Corners, stiffness: float | None) -> Floats | None:
    """Held-out errors (n, 2) in px; None: a fit does not show all held-out corners."""
    try:
        return held_out_errors(candidate, corners, stiffness)
    except OpticsError:
        return None


def _chosen(
    candidates: Sequence[Candidate], errors: Mapping[str, Floats], corners: Corners
) -> Candidate:
    """Model with the fewest parameters among those as good as the best one on held-out images.

    A model is as good if its mean squared error exceeds that of the best one by at most the
    standard error of the mean difference over the images, and by at most `MAX_EXCESS`. With few
    images, the standard error alone would permit too large an excess.

    Source: the one-standard-error rule, Hastie, Tibshirani & Friedman, The Elements of Statistical
        Learning (2009), 7.10.
    """
    counts = np.diff(corners.starts)
    sums = {
        name: np.square(errors[name]).sum(axis=1)
        for name in (candidate.name for candidate in candidates)
    }
    squared = {
        name: np.add.reduceat(values, corners.starts[:-1]) / counts for name, values in sums.items()
    }
    best = min(squared, key=lambda name: float(squared[name].mean()))

    def is_as_good(name: str) -> bool:
        excess = squared[name] - squared[best]
        error = float(excess.std(ddof=1)) / math.sqrt(len(excess))
        return float(excess.mean()) <= min(error, MAX_EXCESS * float(squared[best].mean()))

    good = [candidate for candidate in candidates if is_as_good(candidate.name)]
    return min(
        good,
        key=lambda candidate: (
            len(candidate.parameters.start),
            float(squared[candidate.name].mean()),
        ),
    )


# Fits of camera models to boards, and their errors in held-out images.


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

Parameters = ParameterVector[ParametricCamera]


class Candidate(NamedTuple):
    """Camera model of `CANDIDATES` fitted to all images; `parameters` start at the fit."""

    name: str
    parameters: Parameters
    fit: Adjustment


def fit_candidate(
    name: str, corners: Corners, first: Adjustment, stiffness_px_per_m: float | None
) -> Candidate:
    """Fit a model of `CANDIDATES`, starting from a fitted Kannala-Brandt lens.

    Without a stiffness (see `adjust`), the board's shape is not fitted.

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


def select_images(corners: Corners, chosen: Bools) -> Corners:
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


# Quantities of a fitted camera model, with their standard deviations.


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
            "fits without a fifth of the images do not reach the corners in them: show the board "
            "in more images near the edge"
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
