"""Measurement of a lens, or of an optical system, from a board in images.

Faults raise `MeasurementError`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from omnisim.cameras import MirroredCamera
from omnisim.cameras.camera import CentralCamera
from omnisim.cameras.optics.system_calibration import (
    BoardCorners,
    SystemCalibration,
    calibrate_system,
)
from omnisim.core.arrays import Bools, Floats
from omnisim.core.errors import CalibrationError, MeasurementError, OpticsError
from omnisim.measurement import Quantity, Unobservable
from omnisim.measurement.geometry.board_detection import MIN_CORNERS
from omnisim.measurement.geometry.boards import BoardView, RejectedImage
from omnisim.measurement.geometry.bundle_adjustment import (
    Adjustment,
    Corners,
    initial_adjustment,
    rms_px,
)
from omnisim.measurement.geometry.model_choice import (
    CANDIDATES,
    Candidate,
    ModelResult,
    choose_model,
    fit_candidate,
    held_out_errors,
    model_quantities,
    unobservable_quantities,
)

OPTICS = "optics"  # name of the model of an optical system
_FOLDS = 5  # of images, each held out once
_UNITS = {"m": "m", "deg": "°", "px": "px"}


@dataclass(frozen=True, eq=False)
class MeasuredGeometry:
    """Camera model measured from a board in images."""

    camera: CentralCamera  # camera with the chosen model, or a fitted optical system
    model: str  # name of the chosen model; "optics": an optical system
    models: tuple[ModelResult, ...]  # all models, the best on held-out images first
    views: tuple[BoardView, ...]  # view of the board in each used image
    # (images, 4, 4) optical_from_board; if mirrored, for the lens, not its mirror image
    poses: Floats
    # (corners, 3) measured positions of the board's corners; z = 0 for a flat board
    board_m: Floats
    errors_px: Floats  # (n, 2) measured minus predicted corners of all views, in order
    # root mean square error in held-out images; NaN: no fit shows all their corners
    held_out_rms_px: float
    rejected: tuple[RejectedImage, ...]  # rejected images with their reasons
    quantities: tuple[Quantity, ...]  # parameters of the camera
    unobservable: tuple[Unobservable, ...]  # quantities that the images do not determine

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
    the best one, the model with the fewest parameters is chosen. At most 40 images choose the
    model, which is then fitted to all.

    Args:
        views, size_px: view of the board in each image, and width and height of the images.
        mirrored: True if the camera looks into a mirror.
        models: names of the models to try, from `CANDIDATES`.
        is_flat: True: the board is assumed exactly flat and exactly printed.

    Raises:
        MeasurementError: too few images, boards that do not determine the lens, a board unlike its
            description, or no model that fits the lens.

    Source: Strobl & Hirzinger, "More accurate pinhole camera calibration with imperfect planar
        target" (ICCV Workshops 2011), for the shape of the board.
    """
    used, rejected = _remove_copies(views)
    used, outlying, initial = _remove_outliers(used, lambda kept: _fit_lens(kept, size_px))
    corners = Corners.of(used)
    _check_focal_length(initial)
    spacing_m = _min_spacing_m(corners.nominal_m)
    stiffness = None
    if not is_flat and len(used) >= MIN_SHAPE_IMAGES:
        initial, stiffness = _fit_shape(corners, initial, spacing_m)
    choice = choose_model(models, corners, initial, stiffness)
    chosen = choice.chosen
    fit = chosen.fit
    _check_shape(fit.shape_m, spacing_m, corners)
    return MeasuredGeometry(
        MirroredCamera(fit.camera) if mirrored else fit.camera, chosen.name, choice.models,
        tuple(used), fit.poses, corners.nominal_m + fit.shape_m, fit.errors_px,
        choice.held_out_rms_px, (*rejected, *outlying), model_quantities(chosen, corners),
        unobservable_quantities(fit, corners, math.isfinite(choice.held_out_rms_px)),
    )  # fmt: skip


def measure_optics(
    table: Mapping[str, Any], free: Sequence[str], views: Sequence[BoardView], name: str = "optics"
) -> MeasuredGeometry:
    """Fit parameters of an optical system to a flat board in several images.

    The errors in held-out images are those of fits without a fifth of the images.

    Args:
        table, name: table of the optics file, close to the true values, and its name for messages.
        free: keys of the parameters to fit, see `FreeParameters`.
        views: view of the board in each image.

    Raises:
        MeasurementError: too few images, corners that the system does not show, or images that do
            not determine the parameters.
    """

    def fit_system(kept: Sequence[BoardView]) -> FittedViews[SystemCalibration]:
        fit = calibrate_system(table, free, _boards(kept), name)
        return FittedViews(fit.errors_px, fit)

    used, copies = _remove_copies(views)
    try:
        used, outlying, fit = _remove_outliers(used, fit_system)
    except OpticsError as reason:
        raise MeasurementError(str(reason)) from None
    held_out_px = _held_out_rms_px(fit, free, used, name)
    corners = Corners.of(used)
    rms = rms_px(fit.errors_px)
    basis = f"{len(corners.label)} corners in {len(used)} images"
    quantities = []
    for fitted in fit.parameters:  # of a key such as `surfaces.0.tilt_deg.1`
        names = [part for part in fitted.name.split(".") if not part.isdecimal()]
        unit = _UNITS.get(names[-1].rpartition("_")[2], "")
        quantities.append(Quantity(fitted.name, fitted.value, fitted.sigma, unit, basis))
    hidden = "fits without a fifth of the images do not reach the corners in them"
    unobservable = (Unobservable("held_out_rms_px", hidden),) if math.isnan(held_out_px) else ()
    return MeasuredGeometry(
        fit.system,
        OPTICS,
        (ModelResult(OPTICS, len(fit.parameters), rms, held_out_px),),
        tuple(used),
        fit.poses,
        corners.nominal_m,
        -fit.errors_px,  # measured minus predicted
        held_out_px,
        (*copies, *outlying),
        tuple(quantities),
        unobservable,
    )  # fmt: skip


def _held_out_rms_px(
    fit: SystemCalibration, free: Sequence[str], views: Sequence[BoardView], name: str
) -> float:
    """Root mean square error in held-out images; NaN: a fit does not show all their corners."""
    errors: list[Floats] = []
    try:
        for fold in range(_FOLDS):
            is_left_out = np.arange(len(views)) % _FOLDS == fold
            trained, left_out = (
                [view for view, is_used in zip(views, used, strict=True) if is_used]
                for used in (~is_left_out, is_left_out)
            )
            system = calibrate_system(
                fit.table, free, _boards(trained), name, fit.poses[~is_left_out]
            )
            tested = calibrate_system(
                system.table, (), _boards(left_out), name, fit.poses[is_left_out]
            )
            errors.append(tested.errors_px)
    except OpticsError:
        return math.nan
    return rms_px(np.concatenate(errors))


def _boards(views: Sequence[BoardView]) -> list[BoardCorners]:
    return [BoardCorners(view.points_m, view.pixels_px) for view in views]


# Rejection of images and corners that do not fit one lens and one rigid board.


MIN_IMAGES = 5
MAX_REJECTED = 0.34  # largest share of rejected images
MAX_FOCAL_SIGMA = 0.03
MIN_DECENTERED = 0.8  # error with decentering relative to that without, below which it is used
CHECK_BOARD = "check the board's size, and that its squares are square and of one size"
Fit = TypeVar("Fit")
_MAX_IMAGE_RATIO = 4.0  # factor of the images' median error
_MAX_CORNER_RATIO = 8.0  # factor of the corners' median error: 9.4 standard deviations


class FittedViews(NamedTuple, Generic[Fit]):
    """Camera, poses and so on fitted to views, and errors (n, 2) of all corners in order."""

    errors_px: Floats
    fit: Fit


def _remove_copies(views: Sequence[BoardView]) -> tuple[list[BoardView], list[RejectedImage]]:
    """Views without duplicates (bit-identical corners), and the rejected images."""
    known: dict[bytes, str] = {}
    used, rejected = [], []
    for view in views:
        earlier = known.setdefault(view.pixels_px.tobytes(), view.name)
        if earlier == view.name:
            used.append(view)
        else:
            rejected.append(RejectedImage(view.name, f"the same image as {earlier}"))
    return used, rejected


def _remove_outliers(
    views: list[BoardView], fit: Callable[[list[BoardView]], FittedViews[Fit]]
) -> tuple[list[BoardView], list[RejectedImage], Fit]:
    """Views that fit one camera, rejected images, and the fit to these views, made by `fit`."""
    rejected: list[RejectedImage] = []
    count = len(views)
    while True:
        if len(views) < MIN_IMAGES:
            found = f"{len(views)} images with a usable board"
            raise MeasurementError(f"{found}: expected at least {MIN_IMAGES}")
        fitted = fit(views)
        corners = Corners.of(views)
        lengths = np.linalg.norm(fitted.errors_px, axis=1)
        ends = zip(corners.starts[:-1], corners.starts[1:], strict=True)
        medians = np.array([np.median(lengths[slice(*pair)]) for pair in ends])
        worst, usual = int(np.argmax(medians)), float(np.median(medians))
        if medians[worst] > max(_MAX_IMAGE_RATIO * usual, 0.1):
            reason = f"{medians[worst]:.2g} px off a lens that fits the others to {usual:.2g} px"
            rejected.append(RejectedImage(views[worst].name, reason))
            views = [view for index, view in enumerate(views) if index != worst]
            if len(rejected) > MAX_REJECTED * count:
                raise MeasurementError(
                    f"{len(rejected)} of {count} images contradict the others: expected one "
                    "camera, one lens setting and one rigid board"
                )
            continue
        is_outlier = lengths > max(_MAX_CORNER_RATIO * float(np.median(lengths)), 0.3)
        if not is_outlier.any():
            return views, rejected, fitted.fit
        _check_board(is_outlier, corners)
        kept = []
        for index, view in enumerate(views):
            is_used = ~is_outlier[slice(*corners.starts[index : index + 2])]
            if is_used.sum() < MIN_CORNERS:
                reason = f"{(~is_used).sum()} of {len(is_used)} corners are outliers"
                rejected.append(RejectedImage(view.name, reason))
            else:
                kept.append(BoardView(view.name, view.points_m[is_used], view.pixels_px[is_used]))
        views = kept


def _fit_lens(views: list[BoardView], size_px: tuple[int, int]) -> FittedViews[Adjustment]:
    """Preliminary lens of views in images of a size, with the errors that judge outliers."""
    initial = initial_adjustment(views, size_px)
    return FittedViews(_preliminary_lens(initial, Corners.of(views)).fit.errors_px, initial)


def _check_board(is_outlier: Bools, corners: Corners) -> None:
    """Reject a board with a corner that is an outlier (n,) in more than half of its images."""
    seen = np.bincount(corners.label, minlength=len(corners.nominal_m))
    off = np.bincount(corners.label[is_outlier], minlength=len(corners.nominal_m))
    worst = int(np.argmax(off / np.maximum(seen, 1)))
    if 2 * off[worst] > seen[worst]:
        x, y = 1e3 * corners.nominal_m[worst, :2]
        raise MeasurementError(
            f"the board's corner at ({x:.4g}, {y:.4g}) mm is off its place in {off[worst]} of "
            f"{seen[worst]} images: {CHECK_BOARD}"
        )


def _check_focal_length(initial: Adjustment) -> None:
    """Reject boards that do not determine the focal length."""
    sigma = float(initial.unit_sigmas[0]) * initial.rms_px
    focal = float(initial.camera.parameters()["focal_lengths_px"][0])  # type: ignore[arg-type, index]
    normals = initial.poses[:, :3, 2]
    spread = float(np.degrees(np.arccos(np.clip((normals @ normals.T).min(), -1.0, 1.0))))
    if not sigma <= MAX_FOCAL_SIGMA * focal:
        raise MeasurementError(
            f"the boards do not determine the focal length: {focal:.4g} ± {sigma:.2g} px; they "
            f"face within {spread:.0f}° of each other: tilt the board, and show it near the edges"
        )


def _preliminary_lens(initial: Adjustment, corners: Corners) -> Candidate:
    """Preliminary lens for the rejection of outliers and the choice of the board's shape.

    A Kannala-Brandt lens, unless the unified model with decentering (a misaligned mirror) fits
    better.
    """
    radial = fit_candidate("kannala_brandt", corners, initial, None)
    try:
        decentered = fit_candidate("unified", corners, initial, None)
    except (CalibrationError, OpticsError):
        return radial
    is_better = decentered.fit.rms_px < MIN_DECENTERED * radial.fit.rms_px
    return decentered if is_better else radial


# Shape of a printed board, fitted together with the lens.


MIN_SHAPE_IMAGES = 8  # images required to separate a board's shape from the lens
SHAPE_SIGMA = 0.02  # assumed sigma of a board's corners, as a share of their spacing
MAX_SHAPE_ERROR = 0.06  # largest error of a corner, as a share of the spacing


def _fit_shape(
    corners: Corners, initial: Adjustment, spacing_m: float
) -> tuple[Adjustment, float | None]:
    """Fit the board's shape, if that predicts held-out images better than a flat board.

    Returns fit of the lens, and stiffness of the board in px/m; None: the board is flat.
    """
    flat = _preliminary_lens(initial, corners)
    stiffness = flat.fit.rms_px / (SHAPE_SIGMA * spacing_m)
    try:
        bent = fit_candidate(flat.name, corners, initial, stiffness)
        errors = [held_out_errors(flat, corners, None), held_out_errors(bent, corners, stiffness)]
    except (CalibrationError, OpticsError):
        return initial, None
    if rms_px(errors[1]) < rms_px(errors[0]):
        return initial._replace(poses=bent.fit.poses, shape_m=bent.fit.shape_m), stiffness
    return initial, None


def _check_shape(shape_m: Floats, spacing_m: float, corners: Corners) -> None:
    """Reject a board whose fitted shape is far from its nominal shape."""
    offsets = np.linalg.norm(shape_m[:, :2], axis=1)
    worst = int(np.argmax(offsets))
    if offsets[worst] > MAX_SHAPE_ERROR * spacing_m:
        x, y = 1e3 * corners.nominal_m[worst, :2]
        raise MeasurementError(
            f"the board's corner at ({x:.4g}, {y:.4g}) mm is {1e3 * offsets[worst]:.2g} mm off its "
            f"place in all images ({100.0 * offsets[worst] / spacing_m:.0f} % of a square): "
            f"{CHECK_BOARD}"
        )


def _min_spacing_m(nominal_m: Floats) -> float:
    """Smallest distance between two corners of a board, m."""
    distances = np.linalg.norm(nominal_m[:, None] - nominal_m, axis=2)
    np.fill_diagonal(distances, np.inf)
    return float(distances.min())
