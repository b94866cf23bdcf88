"""Measurement of a camera model from a board in images."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from omnisim.cameras import MirroredCamera
from omnisim.cameras.camera import CentralCamera
from omnisim.measurement.geometry.board_shape import (
    MIN_SHAPE_IMAGES,
    check_shape,
    fit_shape,
    min_spacing_m,
)
from omnisim.measurement.geometry.board_view import BoardView, RejectedImage
from omnisim.measurement.geometry.bundle_adjustment import Corners, Floats, rms_px
from omnisim.measurement.geometry.candidate_models import CANDIDATES
from omnisim.measurement.geometry.model_choice import ModelResult, choose_model
from omnisim.measurement.geometry.model_quantities import model_quantities, unobservable_quantities
from omnisim.measurement.geometry.outliers import (
    check_focal_length,
    fit_lens,
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
