"""Rejection of images and corners that do not fit one lens and one rigid board."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import CalibrationError, MeasurementError, OpticsError
from omnisim.measurement.geometry.board_detection import MIN_CORNERS
from omnisim.measurement.geometry.boards import BoardView, RejectedImage
from omnisim.measurement.geometry.bundle_adjustment import (
    Adjustment,
    Corners,
    Floats,
    initial_adjustment,
)
from omnisim.measurement.geometry.model_choice import Candidate, fit_candidate

MIN_IMAGES = 5
MAX_REJECTED = 0.34  # largest share of rejected images
MAX_FOCAL_SIGMA = 0.03
MIN_DECENTERED = 0.8  # error with decentering relative to that without, below which it is used
CHECK_BOARD = "check the board's size, and that its squares are square and of one size"
Fit = TypeVar("Fit")
_MAX_IMAGE_RATIO = 4.0  # factor of the images' median error
_MAX_CORNER_RATIO = 8.0  # factor of the corners' median error: 9.4 standard deviations


class FittedViews(NamedTuple, Generic[Fit]):
    """Camera fitted to views.

    Attributes:
        errors_px: (n, 2) errors of all corners, in the order of the views.
        fit: fitted camera, poses and whatever belongs to them.
    """

    errors_px: Floats
    fit: Fit


def remove_copies(views: Sequence[BoardView]) -> tuple[list[BoardView], list[RejectedImage]]:
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


def remove_outliers(
    views: list[BoardView], fit: Callable[[list[BoardView]], FittedViews[Fit]]
) -> tuple[list[BoardView], list[RejectedImage], Fit]:
    """Views that fit one camera, rejected images, and the fit to these views.

    Args:
        views: view of the board in each image.
        fit: fits a camera to views.

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
        views = _without_corners(views, is_outlier, corners, rejected)


def fit_lens(views: list[BoardView], size_px: tuple[int, int]) -> FittedViews[Adjustment]:
    """Preliminary lens of views, with the errors of the lens that judges outliers.

    Args:
        views: view of the board in each image.
        size_px: width and height of the images.

    Raises:
        MeasurementError: no lens fits.
    """
    first = initial_adjustment(views, size_px)
    return FittedViews(preliminary_lens(first, Corners.of(views)).fit.errors_px, first)


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
            f"{seen[worst]} images: {CHECK_BOARD}"
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


def check_focal_length(first: Adjustment) -> None:
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


def preliminary_lens(first: Adjustment, corners: Corners) -> Candidate:
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
