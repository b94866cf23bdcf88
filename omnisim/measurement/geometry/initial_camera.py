"""Initial camera and poses from corners alone: an equidistant lens, then Kannala and Brandt's."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import KannalaBrandtCamera
from omnisim.cameras.calibration.linear_fit import FITTED
from omnisim.cameras.calibration.parameter_vector import ParameterVector
from omnisim.cameras.optics.boards.board_pose import pose_from_directions
from omnisim.cameras.parametric_camera import ParametricCamera
from omnisim.core.errors import MeasurementError, OpticsError
from omnisim.measurement.geometry.board_view import BoardView
from omnisim.measurement.geometry.bundle_adjustment import Adjustment, Corners, adjust

_WIDEST_RAD = np.geomspace(0.15, 3.0, 32)  # angles of the farthest corner that are tried
_MAX_BOARDS = 20  # used to choose among them
_MAX_RADIUS_RAD = 0.98 * math.pi


def initial_adjustment(views: Sequence[BoardView], size_px: tuple[int, int]) -> Adjustment:
    """Lens of Kannala and Brandt that fits the corners, with the poses of the boards.

    Args:
        views: the board in each image.
        size_px: width and height of the images.

    Raises:
        MeasurementError: no lens fits the corners.
    """
    center = 0.5 * (size_px[0] - 1.0), 0.5 * (size_px[1] - 1.0)
    radius = max(np.linalg.norm(view.pixels_px - center, axis=1).max() for view in views)
    some = views[:: math.ceil(len(views) / _MAX_BOARDS)]
    candidates = []
    for widest in _WIDEST_RAD:
        focal = float(radius / widest)
        lens = KannalaBrandtCamera(*size_px, (focal, focal), center, (0.0,) * 4)
        residuals = [_first_residual_px(lens, view) for view in some]
        candidates.append((float(np.median(residuals)), lens))
    first = min(candidates, key=lambda candidate: candidate[0])[1]
    poses = np.stack([_first_pose(first, view) for view in views])
    camera: ParametricCamera = first
    corners = Corners.of(views)
    free = FITTED[KannalaBrandtCamera].free
    stages: tuple[list[str], ...] = (
        [f"coefficients.{index}" for index in range(4)]
        + ["principal_point_px.0", "principal_point_px.1"],
        ["coefficients.2", "coefficients.3"],
        [],
    )
    for fixed in stages:
        parameters: ParameterVector[ParametricCamera] = ParameterVector(camera, free, fixed)
        try:
            fitted = adjust(parameters, corners, poses)
        except OpticsError as reason:
            raise MeasurementError(f"no lens fits the corners: {reason}") from None
        camera, poses = fitted.camera, fitted.poses
    return fitted


def _directions(camera: KannalaBrandtCamera, view: BoardView) -> NDArray[np.float64]:
    """Directions (n, 3) of a view's corners through an equidistant lens, optical frame."""
    offsets = (view.pixels_px - camera.principal_point_px) / camera.focal_lengths_px
    theta = np.linalg.norm(offsets, axis=1, keepdims=True)
    across = offsets * np.sinc(theta / math.pi)
    return np.concatenate((across, np.cos(theta)), axis=1)


def _first_pose(camera: KannalaBrandtCamera, view: BoardView) -> NDArray[np.float64]:
    return pose_from_directions(_directions(camera, view), view.points_m)


def _first_residual_px(camera: KannalaBrandtCamera, view: BoardView) -> float:
    """Root mean square of a board's angular errors, times the focal length, px."""
    pose = _first_pose(camera, view)
    predicted = view.points_3d_m @ pose[:3, :3].T + pose[:3, 3]
    predicted /= np.linalg.norm(predicted, axis=1, keepdims=True)
    errors = np.linalg.norm(predicted - _directions(camera, view), axis=1)
    return camera.focal_lengths_px[0] * float(np.sqrt(np.mean(errors**2)))
