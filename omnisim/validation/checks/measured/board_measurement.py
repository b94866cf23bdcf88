"""Camera models measured from rendered boards: errors of their rays and of images by the models."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from omnisim.cameras import KannalaBrandtCamera, OcamcalibCamera, UnifiedCamera
from omnisim.cameras.camera import CentralCamera
from omnisim.core.errors import MeasurementError
from omnisim.measurement.comparison import compare_images
from omnisim.measurement.comparison.comparison import compare_image
from omnisim.measurement.geometry import BoardView, Chessboard, measure_geometry
from omnisim.measurement.geometry.board_detection import find_board
from omnisim.rendering.camera.degradations import Degradation, Noise, Vignetting
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.report.report import Measure, ResultTable, Section
from omnisim.validation.fixture import Fixture
from omnisim.validation.plain_scenes import PATTERN, SQUARE_M, board_images, board_poses_in_front

IMAGES, TWINS = 24, 4
BOARD = Chessboard(*PATTERN, SQUARE_M)
DEGRADATION = Degradation(vignetting=Vignetting((-0.25, 0.05, -0.01)), noise=Noise())
HELD_OUT_BOUND_PX, RAY_BOUND_PX, BIAS_BOUND_PX = 0.15, 0.3, 0.05
LEVEL_BOUND, RISE_BOUND = 4.0, 0.15
MIRROR = "misaligned mirror"
_RAYS = 1  # index of the error of the rays among the numbers of a camera
OMNIDIR_BOUND = 1.02  # a model with fewer numbers may leave that much more


def cameras() -> dict[str, tuple[CentralCamera, float]]:
    """Cameras to measure, by name, each with the maximum angle in rad from the axis to a board."""
    size, turned_rad = (640, 480), np.radians(58.0)
    poly, affine = (-200.0, 0.0, 1.2e-3, -1e-6, 3e-9), (0.999, 2e-4, 0.0)
    return {
        "fisheye": (KannalaBrandtCamera(*size, (205.0, 205.4), (322.5, 237.0),
                                        (0.012, -8e-3, 2e-3, -5e-4)), turned_rad),
        "wide angle": (UnifiedCamera(*size, (360.0, 360.6), (316.0, 243.0), 0.0,
                                     (-0.28, 0.08, 4e-4, -3e-4)), np.radians(24.0)),
        "omnidirectional": (OcamcalibCamera(*size, (322.0, 236.0), poly, affine), turned_rad),
        # decentered as OpenCV's own set of an omnidirectional camera
        MIRROR: (UnifiedCamera(*size, (245.0, 245.6), (316.0, 236.0), 1.03,
                               (-0.02, 0.012, 0.01, -4e-3)), turned_rad),
    }  # fmt: skip


def check(fixture: Fixture, title: str) -> Section:
    """Render boards with known cameras, measure these, and compare the results with the truth."""
    hidden = list(cameras().items())[: 1 if fixture.is_quick else None]
    rows, worst, excess = [], np.zeros(5), 0.0
    for name, (camera, widest_rad) in hidden:
        sensor = OmniCamera(camera, degradation=DEGRADATION)
        detected = []
        poses = board_poses_in_front(IMAGES, widest_rad, camera.rig_from_optical)
        for number, rgb in enumerate(board_images(fixture, sensor, poses)):
            image = np.ascontiguousarray(rgb[..., 1])
            with suppress(MeasurementError):  # partly outside of the image
                detected.append((find_board(image, BOARD, f"image {number}"), image))
        measured = measure_geometry([view for view, _ in detected], (640, 480))
        twin = OmniCamera(measured.camera, degradation=DEGRADATION)
        compared = []
        for view, image in detected[:: max(1, len(detected) // TWINS)]:
            with suppress(MeasurementError):  # not detected in the twin's image, at its edge
                compared.append(compare_image(twin, BOARD, view, image, measured.board_m))
        comparison = compare_images(twin, compared)
        rise = max(abs(ring.twin_rise_px / ring.rise_px - 1.0) for ring in comparison.rings)
        ray_px = ray_error_px(camera, measured.camera, [view for view, _ in detected])
        level = float(np.percentile(np.abs(comparison.level_errors), 90.0))
        numbers = np.array((measured.held_out_rms_px, ray_px, comparison.bias_px, level, rise))
        excess = max(excess, measured.rms_px / omnidir_rms_px(measured.views))
        bounded = numbers.copy()
        if name == MIRROR:
            bounded[_RAYS] = 0.0
        worst = np.maximum(worst, bounded)
        cells = [f"{number:.3f}" for number in numbers.tolist()]
        rows.append((name, str(len(detected)), measured.model, *cells))
    held_out, rays, bias, levels, rise_error = worst.tolist()
    columns = ("camera", "boards", "model", "held out px", "rays px", "bias px", "levels", "rise")
    return Section(
        title,
        f"{len(hidden)} simulated cameras with vignetting and noise take {IMAGES} images of a "
        "chessboard. `omnisim measure geometry` receives the corners detected by OpenCV, and "
        "chooses a model by its errors in held-out images. Its rays are compared with the true "
        "rays, up to a rotation, which boards do not determine. The twin's images of the same "
        "boards are compared with the camera's: detected corners, gray levels of the squares, "
        "10-90 % rise of edges. The rays of the mirror have no bound: these boards do not separate "
        "its focal lengths from ξ and its decentering; the standard deviation of its focal lengths "
        "is 3 %.",
        (
            Measure("corners in held-out images, RMS", held_out, "px", HELD_OUT_BOUND_PX),
            Measure("corners, RMS over that of cv2.omnidir", excess, "", OMNIDIR_BOUND),
            Measure("rays over the field of the corners, except the mirror's, largest error",
                    rays, "px", RAY_BOUND_PX),
            Measure("corners in the twin's images, bias by ring", bias, "px", BIAS_BOUND_PX),
            Measure("gray levels of 90 % of the squares", levels, "of 255", LEVEL_BOUND),
            Measure("rise of edges by ring, relative", rise_error, "", RISE_BOUND),
        ),
        (ResultTable("Largest errors of each camera", columns, tuple(rows)),),
    )  # fmt: skip


def ray_error_px(true: CentralCamera, measured: CentralCamera, views: list[BoardView]) -> float:
    """Maximum distance in px between the rays of two cameras, projected into the true image.

    The rays are those of the boards' corners; a rotation aligns the two sets of rays first.

    Source: Kabsch 1976, for the rotation.
    """
    pixels = np.concatenate([view.pixels_px for view in views])
    rays = [camera.ray_from_pixel(pixels).directions for camera in (true, measured)]
    left, _, right = np.linalg.svd(rays[0].T @ rays[1])
    turned = rays[1] @ (left @ right).T
    seen = true.pixel_from_ray(turned).positions_px
    return float(np.linalg.norm(seen - pixels, axis=1).max())


def omnidir_rms_px(views: Sequence[BoardView]) -> float:
    """Root mean square error that OpenCV's omnidirectional calibration leaves at the corners."""
    import cv2

    stop = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 500, 1e-9)
    objects = [view.points_3d_m[:, None] for view in views]
    images = [view.pixels_px[:, None] for view in views]
    unknown: Any = None
    return cv2.omnidir.calibrate(objects, images, (640, 480), unknown, unknown, unknown, 0, stop)[0]
