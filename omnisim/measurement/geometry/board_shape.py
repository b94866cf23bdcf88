"""Shape of a printed board, fitted together with the lens."""

from __future__ import annotations

import numpy as np

from omnisim.core.errors import CalibrationError, MeasurementError, OpticsError
from omnisim.measurement.geometry.board_view import BoardView
from omnisim.measurement.geometry.bundle_adjustment import Adjustment, Corners, Floats, rms_px
from omnisim.measurement.geometry.candidate_models import fit_candidate, held_out_errors
from omnisim.measurement.geometry.outliers import CHECK_BOARD, preliminary_lens

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
