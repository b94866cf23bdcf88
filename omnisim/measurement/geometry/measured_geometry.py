"""Measurement of a camera model from a board in images."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from omnisim.cameras import MirroredCamera
from omnisim.cameras.camera import CentralCamera
from omnisim.cameras.optics.boards.board_corners import BoardCorners
from omnisim.cameras.optics.boards.calibrate import SystemCalibration, calibrate_system
from omnisim.core.errors import CalibrationError, MeasurementError, OpticsError
from omnisim.measurement.geometry.boards import BoardView, RejectedImage
from omnisim.measurement.geometry.bundle_adjustment import Adjustment, Corners, Floats, rms_px
from omnisim.measurement.geometry.model_choice import (
    CANDIDATES,
    ModelResult,
    choose_model,
    fit_candidate,
    held_out_errors,
    model_quantities,
    unobservable_quantities,
)
from omnisim.measurement.geometry.outliers import (
    CHECK_BOARD,
    FittedViews,
    check_focal_length,
    fit_lens,
    preliminary_lens,
    remove_copies,
    remove_outliers,
)
from omnisim.measurement.quantity import Quantity, Unobservable


@dataclass(frozen=True, eq=False)
class MeasuredGeometry:
    """Camera model measured from a board in images.

    Attributes:
        camera: camera with the chosen model, or a fitted optical system.
        model: name of the chosen model; "optics": an optical system.
        models: all models, the best on held-out images first.
        views: view of the board in each used image.
        poses: (images, 4, 4) optical_from_board; if mirrored, for the lens, not its mirror image.
        board_m: (corners, 3) measured positions of the board's corners; z = 0 for a flat board.
        errors_px: (n, 2) measured minus predicted corners of all views, in order.
        held_out_rms_px: root mean square error in held-out images; NaN: no fit shows all their
            corners.
        rejected: rejected images with their reasons.
        quantities: parameters of the camera.
        unobservable: quantities that the images do not determine.
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
    unobservable: tuple[Unobservable, ...]

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
    the best one, the model with the fewest parameters is chosen. At most 40 images
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
    used, rejected = remove_copies(views)
    used, outlying, first = remove_outliers(used, lambda kept: fit_lens(kept, size_px))
    corners = Corners.of(used)
    check_focal_length(first)
    spacing_m = min_spacing_m(corners.nominal_m)
    stiffness = None
    if not is_flat and len(used) >= MIN_SHAPE_IMAGES:
        used, first, stiffness = fit_shape(used, first, spacing_m)
        corners = Corners.of(used, corners.nominal_m)
    choice = choose_model(models, corners, first, stiffness)
    chosen = choice.chosen
    fit = chosen.fit
    check_shape(fit.shape_m, spacing_m, corners)
    return MeasuredGeometry(
        MirroredCamera(fit.camera) if mirrored else fit.camera,
        chosen.name,
        choice.models,
        tuple(used),
        fit.poses,
        corners.nominal_m + fit.shape_m,
        fit.errors_px,
        choice.held_out_rms_px,
        (*rejected, *outlying),
        model_quantities(chosen, corners),
        unobservable_quantities(fit, corners, is_held_out=choice.is_held_out),
    )


# Shape of a printed board, fitted together with the lens.


MIN_SHAPE_IMAGES = 8  # images required to separate a board's shape from the lens
SHAPE_SIGMA = 0.02  # assumed sigma of a board's corners, as a share of their spacing
MAX_SHAPE_ERROR = 0.06  # largest error of a corner, as a share of the spacing


def fit_shape(
    views: list[BoardView], first: Adjustment, spacing_m: float
) -> tuple[list[BoardView], Adjustment, float | None]:
    """Fit the board's shape, if that predicts held-out images better than a flat board.

    Returns:
        Views, fit of the lens, and stiffness of the board in px/m; None: the board is flat.
    """
    corners = Corners.of(views)
    flat = preliminary_lens(first, corners)
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


def check_shape(shape_m: Floats, spacing_m: float, corners: Corners) -> None:
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
            f"{CHECK_BOARD}"
        )


def min_spacing_m(nominal_m: Floats) -> float:
    """Smallest distance between two corners of a board, m."""
    distances = np.linalg.norm(nominal_m[:, None] - nominal_m, axis=2)
    np.fill_diagonal(distances, np.inf)
    return float(distances.min())


# Measurement of a non-central optical system from a board in images: misalignments of mirrors.


OPTICS = "optics"  # name of the model of an optical system
_FOLDS = 5
_UNITS = {"m": "m", "deg": "°", "px": "px"}


def measure_optics(
    table: Mapping[str, Any], free: Sequence[str], views: Sequence[BoardView], name: str = "optics"
) -> MeasuredGeometry:
    """Fit parameters of an optical system to a flat board in several images.

    The errors in held-out images are those of fits without a fifth of the images.

    Args:
        table: table of the optics file, close to the true values.
        free: keys of the parameters to fit, see `FreeParameters`.
        views: view of the board in each image.
        name: name of the optics file, for messages.

    Raises:
        MeasurementError: too few images, corners that the system does not show, or images that do
            not determine the parameters.
    """
    used, copies = remove_copies(views)
    try:
        used, outlying, fit = remove_outliers(used, lambda kept: _fit(table, free, kept, name))
    except OpticsError as reason:
        raise MeasurementError(str(reason)) from None
    held_out_px = _held_out_rms_px(fit, free, used, name)
    corners = Corners.of(used)
    rms = rms_px(fit.errors_px)
    basis = f"{len(corners.label)} corners in {len(used)} images"
    hidden = "fits without a fifth of the images do not show all corners"
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
        tuple(
            Quantity(one.name, one.value, one.sigma, _unit(one.name), basis)
            for one in fit.parameters
        ),
        unobservable,
    )


def _fit(
    table: Mapping[str, Any], free: Sequence[str], views: Sequence[BoardView], name: str
) -> FittedViews[SystemCalibration]:
    """Parameters fitted to views."""
    fit = calibrate_system(table, free, _boards(views), name)
    return FittedViews(fit.errors_px, fit)


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


def _unit(key: str) -> str:
    """Unit of the parameter of a key such as `surfaces.0.tilt_deg.1`."""
    names = [part for part in key.split(".") if not part.isdecimal()]
    return _UNITS.get(names[-1].rpartition("_")[2], "")
