"""Measurement of a non-central optical system from a board in images: misalignments of mirrors."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from omnisim.cameras.optics.boards.board_corners import BoardCorners
from omnisim.cameras.optics.boards.calibrate import SystemCalibration, calibrate_system
from omnisim.core.errors import MeasurementError, OpticsError
from omnisim.measurement.geometry.board_view import BoardView
from omnisim.measurement.geometry.bundle_adjustment import Corners, Floats, rms_px
from omnisim.measurement.geometry.measured_geometry import MeasuredGeometry
from omnisim.measurement.geometry.model_choice import ModelResult
from omnisim.measurement.geometry.outliers import FittedViews, remove_copies, remove_outliers
from omnisim.measurement.quantity import Quantity, Unobservable

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
