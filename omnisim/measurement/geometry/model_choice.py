"""Choice of a camera model by its errors in held-out images."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from omnisim.core.errors import CalibrationError, MeasurementError, OpticsError
from omnisim.measurement.geometry.bundle_adjustment import Adjustment, Corners, Floats, rms_px
from omnisim.measurement.geometry.candidate_models import (
    Candidate,
    fit_candidate,
    held_out_errors,
    select_images,
)

MAX_COMPARED = 40  # images for the comparison of models; the chosen model is fitted to all
MAX_MODEL_SIGMA = 0.2  # relative sigma of a focal length that correlates with another, as with ξ
MAX_EXCESS = 0.02  # accepted relative excess of squared held-out errors, for fewer parameters
_MAX_ERROR_RATIO = 1.5  # factor of the smallest error of all models; models beyond it are dropped


@dataclass(frozen=True)
class ModelResult:
    """Errors of a camera model fitted to the corners.

    Attributes:
        name: name of the model.
        parameters: number of free parameters; 0: the model could not be fitted.
        rms_px: root mean square distance of the corners from their predictions; NaN: no fit.
        held_out_rms_px: the same in held-out images; NaN: not measured, since the model does not
            fit or does not show all corners. Models other than the chosen one are fitted to at most
            `MAX_COMPARED` images.
        reason: reason for rejecting the model; "": not rejected.
    """

    name: str
    parameters: int
    rms_px: float
    held_out_rms_px: float
    reason: str = ""


@dataclass(frozen=True, eq=False)
class ModelChoice:
    """Camera model chosen by its errors in held-out images.

    Attributes:
        chosen: chosen model, fitted to all images.
        held_out_rms_px: its root mean square error in held-out images; NaN: no fit shows all their
            corners.
        models: results of all models, the best on held-out images first.
    """

    chosen: Candidate
    held_out_rms_px: float
    models: tuple[ModelResult, ...]

    @property
    def is_held_out(self) -> bool:
        """True if the error in held-out images is known."""
        return math.isfinite(self.held_out_rms_px)


def choose_model(
    models: Sequence[str], corners: Corners, first: Adjustment, stiffness: float | None
) -> ModelChoice:
    """Fit models, and choose the one that predicts held-out images with the fewest parameters.

    At most `MAX_COMPARED` images choose the model, which is then fitted to all.

    Args:
        models: names of the models to try.
        corners: corners in the images.
        first: fit of a Kannala-Brandt lens.
        stiffness: stiffness of the board in px/m, see `adjust`; None: its shape is not fitted.

    Raises:
        MeasurementError: no model fits the lens.
    """
    part, start = _subset(corners, first)
    candidates, results = _candidates(models, part, start, stiffness)
    limit = _MAX_ERROR_RATIO * min(one.fit.rms_px for one in candidates)
    errors = {
        one.name: _held_out(one, part, stiffness) if one.fit.rms_px <= limit else None
        for one in candidates
    }
    known = {name: one for name, one in errors.items() if one is not None}
    if known:
        chosen = _chosen([one for one in candidates if one.name in known], known, part)
    else:
        chosen = min(candidates, key=lambda one: one.fit.rms_px)
    if part is not corners:
        chosen, held_out = _refitted(chosen.name, corners, first, stiffness)
        candidates = [chosen if one.name == chosen.name else one for one in candidates]
        known = {name: one for name, one in known.items() if name != chosen.name}
        if held_out is not None:
            known[chosen.name] = held_out
    held_out_rms = {name: rms_px(one) for name, one in known.items()}
    for one in candidates:
        rms = held_out_rms.get(one.name, math.nan)
        results.append(ModelResult(one.name, len(one.parameters.start), one.fit.rms_px, rms))
    results.sort(key=lambda one: (math.isnan(one.held_out_rms_px), one.held_out_rms_px, one.rms_px))
    return ModelChoice(chosen, held_out_rms.get(chosen.name, math.nan), tuple(results))


def _candidates(
    models: Sequence[str], corners: Corners, first: Adjustment, stiffness: float | None
) -> tuple[list[Candidate], list[ModelResult]]:
    """Fitted models, and results of the models that cannot be fitted.

    Raises:
        MeasurementError: no model can be fitted.
    """
    fitted, failed = [], []
    for name in models:
        try:
            candidate = fit_candidate(name, corners, first, stiffness)
            _check_determined(candidate)
            fitted.append(candidate)
        except (CalibrationError, OpticsError) as reason:
            failed.append(ModelResult(name, 0, math.nan, math.nan, str(reason)))
    if not fitted:
        reasons = "; ".join(f"{one.name}: {one.reason}" for one in failed)
        raise MeasurementError(f"no model describes the lens: {reasons}")
    return fitted, failed


def _check_determined(candidate: Candidate) -> None:
    """Reject a model whose focal lengths the corners do not determine separately.

    Raises:
        CalibrationError: the standard deviation of a focal length is too large.
    """
    parameters, fit = candidate.parameters, candidate.fit
    sigmas = fit.unit_sigmas * fit.rms_px
    for label, value, sigma in zip(parameters.labels, parameters.start, sigmas, strict=True):
        if label.startswith("focal_length") and sigma > MAX_MODEL_SIGMA * value:
            numbers = f"{label} = {value:.4g} ± {sigma:.2g} px"
            raise CalibrationError(f"camera: {candidate.name}: not determined: {numbers}")


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


def _refitted(
    name: str, corners: Corners, first: Adjustment, stiffness: float | None
) -> tuple[Candidate, Floats | None]:
    """Model fitted to all images, and its held-out errors (n, 2) in px.

    Raises:
        MeasurementError: the model does not fit the lens in all images.
    """
    try:
        candidate = fit_candidate(name, corners, first, stiffness)
    except (CalibrationError, OpticsError) as reason:
        raise MeasurementError(f"{reason}, in all images") from None
    return candidate, _held_out(candidate, corners, stiffness)


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
    sums = {name: np.square(errors[name]).sum(axis=1) for name in (one.name for one in candidates)}
    squared = {
        name: np.add.reduceat(values, corners.starts[:-1]) / counts for name, values in sums.items()
    }
    best = min(squared, key=lambda name: float(squared[name].mean()))

    def is_as_good(name: str) -> bool:
        excess = squared[name] - squared[best]
        error = float(excess.std(ddof=1)) / math.sqrt(len(excess))
        return float(excess.mean()) <= min(error, MAX_EXCESS * float(squared[best].mean()))

    good = [one for one in candidates if is_as_good(one.name)]
    return min(good, key=lambda one: (len(one.parameters.start), float(squared[one.name].mean())))
