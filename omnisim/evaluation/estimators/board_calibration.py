"""Calibration of a run's first camera from its images of a board.

Sources: OpenCV's modules fisheye (Kannala & Brandt) and omnidir (Mei & Rives); for our method, see
`omnisim.measurement.geometry`.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from omnisim.cameras import CentralCamera, KannalaBrandtCamera, UnifiedCamera
from omnisim.core.errors import EstimatorError
from omnisim.datasets.export.lens_camera import LensCamera
from omnisim.datasets.export.recording import Recording
from omnisim.evaluation.estimator import Estimator
from omnisim.measurement.geometry import BoardView, find_boards, measure_geometry, read_board
from omnisim.measurement.geometry.model_choice import CANDIDATES

MIN_IMAGES = 5
ITERATIONS, PRECISION = 200, 1e-9  # limits of OpenCV's solvers


class BoardCalibration(Estimator):
    """Method that calibrates the first camera from its images of a board, such as "8x6:80mm".

    The description is that of `omnisim measure geometry`.

    Raises:
        MeasurementError: the description of the board is invalid.
    """

    package, module, extra = "opencv-contrib-python-headless", "cv2", "measure"

    def __init__(self, board: str):
        self.board = read_board(board)

    def estimate(self, run: Recording, work: Path) -> CentralCamera:
        """Calibrated camera model."""
        if not run.cameras:
            raise EstimatorError("the run has no camera")
        camera = LensCamera.of(run.cameras[0], lambda note: None)
        if camera.is_flipped:
            raise EstimatorError(f"{camera.name} looks into a mirror: expected a lens")
        files = [camera.recorded.image_file(step) for step in range(len(run.times_s(camera.name)))]
        results = [search.found for search in find_boards(files, self.board)]
        views = [found for found in results if isinstance(found, BoardView)]
        if len(views) < MIN_IMAGES:
            raise EstimatorError(
                f"the board was found in {len(views)} of {len(files)} images: expected at least "
                f"{MIN_IMAGES}"
            )
        return self.calibrate(views, camera.recorded.size_px)

    @abstractmethod
    def calibrate(self, views: Sequence[BoardView], size_px: tuple[int, int]) -> CentralCamera:
        """Calibrate a camera from the board in each image, and the images' width and height.

        Raises:
            OmnisimError: the views do not determine the camera.
        """


class MeasuredCamera(BoardCalibration):
    """`omnisim measure geometry`: the best of all camera models, with the board's shape."""

    title = "omnisim measure geometry"
    models: ClassVar[Sequence[str]] = CANDIDATES

    def calibrate(self, views: Sequence[BoardView], size_px: tuple[int, int]) -> CentralCamera:
        """Choose the model that predicts held-out images best."""
        return measure_geometry(views, size_px, models=self.models).camera


class OpencvFisheyeCalibration(BoardCalibration):
    """`cv2.fisheye.calibrate`, with zero skew."""

    title = "cv2.fisheye"

    def calibrate(self, views: Sequence[BoardView], size_px: tuple[int, int]) -> CentralCamera:
        """Fit the Kannala-Brandt model."""
        import cv2

        names = cv2.fisheye if hasattr(cv2.fisheye, "CALIB_FIX_SKEW") else cv2  # else: OpenCV 5
        flags = names.CALIB_RECOMPUTE_EXTRINSIC | names.CALIB_FIX_SKEW
        start = np.eye(3), np.zeros(4)
        _, matrix, coefficients, _, _ = _calibrated(
            "fisheye", views, size_px, *start, flags=flags, criteria=_criteria()
        )
        focals, middle = (matrix[0, 0], matrix[1, 1]), (matrix[0, 2], matrix[1, 2])
        if min(focals) <= 0.0:
            raise EstimatorError(f"cv2.fisheye.calibrate: diverged to {focals[0]:.4g} px/rad")
        return KannalaBrandtCamera(*size_px, focals, middle, tuple(coefficients.ravel().tolist()))


class OpencvOmnidirCalibration(BoardCalibration):
    """`cv2.omnidir.calibrate`."""

    title = "cv2.omnidir"

    def calibrate(self, views: Sequence[BoardView], size_px: tuple[int, int]) -> CentralCamera:
        """Fit the unified model with distortion."""
        import cv2

        start = np.eye(3), np.zeros(1), np.zeros(4)
        _, matrix, xi, coefficients, *_ = _calibrated(
            "omnidir", views, size_px, *start, cv2.omnidir.CALIB_FIX_SKEW, _criteria()
        )
        focals, middle = (matrix[0, 0], matrix[1, 1]), (matrix[0, 2], matrix[1, 2])
        distortion = tuple(coefficients.ravel().tolist())
        return UnifiedCamera(*size_px, focals, middle, float(xi.ravel()[0]), distortion)


def _criteria() -> tuple[int, int, float]:
    import cv2

    return cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, ITERATIONS, PRECISION


def _calibrated(module: str, views: Sequence[BoardView], *arguments: Any, **options: Any) -> Any:
    """Result of `calibrate` in a module of OpenCV, for the corners of views."""
    import cv2

    points = [view.points_3d_m[None] for view in views]
    pixels = [view.pixels_px[None] for view in views]
    try:
        return getattr(cv2, module).calibrate(points, pixels, *arguments, **options)
    except cv2.error as reason:
        line = str(reason).strip().splitlines()[0]
        raise EstimatorError(f"cv2.{module}.calibrate: {line}") from None
