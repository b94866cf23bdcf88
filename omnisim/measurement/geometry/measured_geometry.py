"""Measurement of a camera model from a board in images: outliers, choice of the model, results."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import FThetaInverseCamera, MirroredCamera
from omnisim.cameras.camera import CentralCamera
from omnisim.core.errors import CalibrationError, MeasurementError, OpticsError
from omnisim.measurement.geometry.board_detection import MIN_CORNERS
from omnisim.measurement.geometry.board_view import BoardView, RejectedImage
from omnisim.measurement.geometry.bundle_adjustment import Adjustment, Corners, rms_px
from omnisim.measurement.geometry.candidate_models import (
    CANDIDATES,
    Candidate,
    fit_candidate,
    held_out_errors,
    select_images,
    widest_angle_rad,
)
from omnisim.measurement.geometry.initial_camera import initial_adjustment
from omnisim.measurement.quantity import Quantity, Unseen

MIN_IMAGES = 5
MAX_COMPARED = 40  # images for the comparison of models; the chosen model is fitted to all
MIN_SHAPE_IMAGES = 8  # images required to separate a board's shape from the lens
SHAPE_SIGMA = 0.02  # assumed sigma of a board's corners, as a share of their spacing
MAX_SHAPE_ERROR = 0.06  # largest error of a corner, as a share of the spacing
MAX_REJECTED = 0.34  # largest share of rejected images
MAX_FOCAL_SIGMA = 0.03
MAX_MODEL_SIGMA = 0.2  # relative sigma of a focal length that correlates with another, as with ξ
MAX_EXCESS = 0.02  # accepted relative excess of squared held-out errors, for fewer parameters
MIN_DECENTERED = 0.8  # error with decentering relative to that without, below which it is used
_FAR_OFF = 1.5  # factor of the smallest error of all models; models beyond it are dropped
_OUTLYING = 4.0  # factor of the images' median error
_OUTLYING_CORNER = 8.0  # factor of the corners' median error: 9.4 standard deviations
_CHECK_BOARD = "check the board's size, and that its squares are square and of one size"
_EDGE_RAD = math.radians(5.0)

Floats = NDArray[np.float64]


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
class MeasuredGeometry:
    """Camera model measured from a board in images.

    Attributes:
        camera: camera with the chosen model.
        model: name of the chosen model.
        models: all models, the best on held-out images first.
        views: view of the board in each used image.
        poses: (images, 4, 4) optical_from_board; if mirrored, for the lens, not its mirror image.
        board_m: (corners, 3) measured positions of the board's corners; z = 0 for a flat board.
        errors_px: (n, 2) measured minus predicted corners of all views, in order.
        held_out_rms_px: root mean square error in held-out images; NaN: no fit shows all their
            corners.
        rejected: rejected images with their reasons.
        quantities: parameters of the camera.
        unseen: quantities that the images do not determine.
    """

    camera: CentralCamera
    model: str
    models: tuple[ModelResult, ...]
    views: tuple[BoardView, ...]
    poses: Floats
    board_m: Floats
    errors_px: Floats
    held_out_rms_px: float
    rejected: tuple[RejectedImage, ...]
    quantities: tuple[Quantity, ...]
    unseen: tuple[Unseen, ...]

    @property
    def rms_px(self) -> float:
        """Root mean square distance of the corners from their predictions."""
        return rms_px(self.errors_px)


def measure_geometry(
    views: Sequence[BoardView],
    size_px: tuple[int, int],
    *,
    mirrored: bool = False,
    models: Sequence[str] = CANDIDATES,
    is_flat: bool = False,
) -> MeasuredGeometry:
    """Measure a camera's model from a board in several images.

    All models are fitted together with the poses of the board. The board's shape is fitted, too, if
    that predicts held-out images better. Among the models that predict held-out images as well as
    the best one, the model with the fewest parameters is chosen. At most `MAX_COMPARED` images
    choose the model, which is then fitted to all.

    Args:
        views: view of the board in each image.
        size_px: width and height of the images.
        mirrored: True if the camera looks into a mirror.
        models: names of the models to try, from `CANDIDATES`.
        is_flat: True: the board is assumed exactly flat and exactly printed.

    Raises:
        MeasurementError: too few images, boards that do not determine the lens, a board unlike its
            description, or no model that fits the lens.

    Source: Strobl & Hirzinger, "More accurate pinhole camera calibration with imperfect planar
        target" (ICCV Workshops 2011), for the shape of the board.
    """
    used, rejected = _without_copies(views)
    used, outlying, first = _without_outliers(used, size_px)
    rejected += outlying
    corners = Corners.of(used)
    _check_focal(first)
    spacing_m = _spacing_m(corners.nominal_m)
    stiffness = None
    if not is_flat and len(used) >= MIN_SHAPE_IMAGES:
        used, first, stiffness = _with_shape(used, first, spacing_m)
        corners = Corners.of(used, corners.nominal_m)
    part, start = _subset(corners, first)
    candidates, results = _candidates(models, part, start, stiffness)
    limit = _FAR_OFF * min(one.fit.rms_px for one in candidates)
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
    fit = chosen.fit
    _check_shape(fit.shape_m, spacing_m, corners)
    for one in candidates:
        rms = rms_px(known[one.name]) if one.name in known else math.nan
        results.append(ModelResult(one.name, len(one.parameters.start), one.fit.rms_px, rms))
    results.sort(key=lambda one: (math.isnan(one.held_out_rms_px), one.held_out_rms_px, one.rms_px))
    return MeasuredGeometry(
        MirroredCamera(fit.camera) if mirrored else fit.camera,
        chosen.name,
        tuple(results),
        tuple(used),
        fit.poses,
        corners.nominal_m + fit.shape_m,
        fit.errors_px,
        rms_px(known[chosen.name]) if chosen.name in known else math.nan,
        tuple(rejected),
        _quantities(chosen, corners),
        _unseen(fit, corners, is_held_out=chosen.name in known),
    )


def _without_copies(views: Sequence[BoardView]) -> tuple[list[BoardView], list[RejectedImage]]:
    """Views without duplicates (bit-identical corners), and the rejected images."""
    known: dict[bytes, str] = {}
    used, rejected = [], []
    for view in views:
        first = known.setdefault(view.pixels_px.tobytes(), view.name)
        if first == view.name:
            used.append(view)
        else:
            rejected.append(RejectedImage(view.name, f"the same image as {first}"))
    return used, rejected


def _without_outliers(
    views: list[BoardView], size_px: tuple[int, int]
) -> tuple[list[BoardView], list[RejectedImage], Adjustment]:
    """Views that fit one lens, rejected images, and the fit of the lens.

    Raises:
        MeasurementError: too few views remain, too many are rejected, or a corner is an outlier in
            most images.
    """
    rejected: list[RejectedImage] = []
    count = len(views)
    while True:
        if len(views) < MIN_IMAGES:
            found = f"{len(views)} images with a usable board"
            raise MeasurementError(f"{found}: expected at least {MIN_IMAGES}")
        first = initial_adjustment(views, size_px)
        corners = Corners.of(views)
        lengths = np.linalg.norm(_judge(first, corners).fit.errors_px, axis=1)
        ends = zip(corners.starts[:-1], corners.starts[1:], strict=True)
        medians = np.array([np.median(lengths[slice(*pair)]) for pair in ends])
        worst, usual = int(np.argmax(medians)), float(np.median(medians))
        if medians[worst] > max(_OUTLYING * usual, 0.1):
            reason = f"{medians[worst]:.2g} px off a lens that fits the others to {usual:.2g} px"
            rejected.append(RejectedImage(views[worst].name, reason))
            views = [view for index, view in enumerate(views) if index != worst]
            if len(rejected) > MAX_REJECTED * count:
                raise MeasurementError(
                    f"{len(rejected)} of {count} images contradict the others: expected one "
                    "camera, one lens setting and one rigid board"
                )
            continue
        is_outlier = lengths > max(_OUTLYING_CORNER * float(np.median(lengths)), 0.3)
        if not is_outlier.any():
            return views, rejected, first
        _check_board(is_outlier, corners)
        views = _without_corners(views, is_outlier, corners, rejected)


def _check_board(is_outlier: NDArray[np.bool_], corners: Corners) -> None:
    """Reject a board with a corner that is an outlier in most images.

    Args:
        is_outlier: (n,) True for outliers.
        corners: corners in the images.

    Raises:
        MeasurementError: a corner is an outlier in more than half of its images.
    """
    seen = np.bincount(corners.label, minlength=len(corners.nominal_m))
    off = np.bincount(corners.label[is_outlier], minlength=len(corners.nominal_m))
    worst = int(np.argmax(off / np.maximum(seen, 1)))
    if 2 * off[worst] > seen[worst]:
        x, y = 1e3 * corners.nominal_m[worst, :2]
        raise MeasurementError(
            f"the board's corner at ({x:.4g}, {y:.4g}) mm is off its place in {off[worst]} of "
            f"{seen[worst]} images: {_CHECK_BOARD}"
        )


def _without_corners(
    views: list[BoardView],
    is_outlier: NDArray[np.bool_],
    corners: Corners,
    rejected: list[RejectedImage],
) -> list[BoardView]:
    """Views without outliers; views with too few remaining corners are appended to `rejected`."""
    kept = []
    for index, view in enumerate(views):
        is_used = ~is_outlier[slice(*corners.starts[index : index + 2])]
        if is_used.sum() < MIN_CORNERS:
            reason = f"{(~is_used).sum()} of {len(is_used)} corners are outliers"
            rejected.append(RejectedImage(view.name, reason))
        else:
            kept.append(BoardView(view.name, view.points_m[is_used], view.pixels_px[is_used]))
    return kept


def _check_focal(first: Adjustment) -> None:
    """Reject boards that do not determine the focal length.

    Raises:
        MeasurementError: the standard deviation of the focal length is too large.
    """
    sigma = float(first.unit_sigmas[0]) * first.rms_px
    focal = float(first.camera.parameters()["focal_lengths_px"][0])  # type: ignore[arg-type, index]
    normals = first.poses[:, :3, 2]
    spread = float(np.degrees(np.arccos(np.clip((normals @ normals.T).min(), -1.0, 1.0))))
    if not sigma <= MAX_FOCAL_SIGMA * focal:
        raise MeasurementError(
            f"the boards do not determine the focal length: {focal:.4g} ± {sigma:.2g} px; they "
            f"face within {spread:.0f}° of each other: tilt the board, and show it near the edges"
        )


def _with_shape(
    views: list[BoardView], first: Adjustment, spacing_m: float
) -> tuple[list[BoardView], Adjustment, float | None]:
    """Fit the board's shape, if that predicts held-out images better than a flat board.

    Returns:
        Views, fit of the lens, and stiffness of the board in px/m; None: the board is flat.
    """
    corners = Corners.of(views)
    flat = _judge(first, corners)
    stiffness = flat.fit.rms_px / (SHAPE_SIGMA * spacing_m)
    try:
        bent = fit_candidate(flat.name, corners, first, stiffness)
        errors = [held_out_errors(flat, corners, None), held_out_errors(bent, corners, stiffness)]
    except (CalibrationError, OpticsError):
        return views, first, None
    if rms_px(errors[1]) < rms_px(errors[0]):
        shaped = first._replace(poses=bent.fit.poses, shape_m=bent.fit.shape_m)
        return views, shaped, stiffness
    return views, first, None


def _judge(first: Adjustment, corners: Corners) -> Candidate:
    """Preliminary lens for the rejection of outliers and the choice of the board's shape.

    It is a Kannala-Brandt lens, unless the unified model with decentering, as for a misaligned
    mirror, fits much better.
    """
    radial = fit_candidate("kannala_brandt", corners, first, None)
    try:
        decentered = fit_candidate("unified", corners, first, None)
    except (CalibrationError, OpticsError):
        return radial
    is_better = decentered.fit.rms_px < MIN_DECENTERED * radial.fit.rms_px
    return decentered if is_better else radial


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


def _check_shape(shape_m: Floats, spacing_m: float, corners: Corners) -> None:
    """Reject a board whose fitted shape is far from its nominal shape.

    Raises:
        MeasurementError: a corner's offset in the plane is too large.
    """
    offsets = np.linalg.norm(shape_m[:, :2], axis=1)
    worst = int(np.argmax(offsets))
    if offsets[worst] > MAX_SHAPE_ERROR * spacing_m:
        x, y = 1e3 * corners.nominal_m[worst, :2]
        raise MeasurementError(
            f"the board's corner at ({x:.4g}, {y:.4g}) mm is {1e3 * offsets[worst]:.2g} mm off its "
            f"place in all images ({100.0 * offsets[worst] / spacing_m:.0f} % of a square): "
            f"{_CHECK_BOARD}"
        )


def _quantities(chosen: Candidate, corners: Corners) -> tuple[Quantity, ...]:
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


def _unseen(fit: Adjustment, corners: Corners, is_held_out: bool) -> tuple[Unseen, ...]:
    """Quantities not determined by the images: the field beyond the corners, the held-out error."""
    unseen = []
    if not is_held_out:
        reason = (
            "without a fifth of the images, no fit reaches the corners in them: show the board in "
            "more images near the edge"
        )
        unseen.append(Unseen("held_out_rms_px", reason))
    reach = widest_angle_rad(fit, corners)
    camera = fit.camera
    v, u = np.mgrid[0 : camera.height_px : 8, 0 : camera.width_px : 8]
    rays = camera.ray_from_pixel(np.stack((u.ravel(), v.ravel()), axis=1).astype(np.float64))
    across = np.linalg.norm(rays.directions[rays.valid][:, :2], axis=1)
    shown = float(np.arctan2(across, rays.directions[rays.valid][:, 2]).max())
    if shown < reach + _EDGE_RAD:
        return tuple(unseen)
    reason = (
        f"corners reach {math.degrees(reach):.1f}° from the axis, the image may reach "
        f"{math.degrees(shown):.1f}°: beyond the corners the model is extrapolated; show the board "
        "at the edge of the image"
    )
    return (*unseen, Unseen("field_of_view", reason))


def _spacing_m(nominal_m: Floats) -> float:
    """Smallest distance between two corners of a board, m."""
    distances = np.linalg.norm(nominal_m[:, None] - nominal_m, axis=2)
    np.fill_diagonal(distances, np.inf)
    return float(distances.min())
