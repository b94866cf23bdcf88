"""OpenCV's omnidir against rendered images: projection with our K and ξ, and its calibration."""

from __future__ import annotations

import math
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from omnisim.cameras import (
    CentralCamera,
    HyperbolicCamera,
    KannalaBrandtCamera,
    PerspectiveCamera,
    UnifiedCamera,
)
from omnisim.cameras.calibration import calibration_of
from omnisim.cameras.mirrors import HyperbolicMirror
from omnisim.core import poses
from omnisim.core.arrays import Bytes, Floats
from omnisim.plots.style import gallery
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.report.report import CaptionedFigure, Measure, Section
from omnisim.validation.fixture import Fixture, linear_image, max_abs, mean_abs, mirror_camera
from omnisim.validation.image_differences import displacement_figure
from omnisim.validation.oracles import omnidir
from omnisim.validation.plain_scenes import (
    PATTERN,
    Markers,
    board_corners_m,
    board_images,
    board_poses,
    board_poses_in_front,
    detected_boards,
    marker_rims,
    rim_centroids_px,
)

MARKERS = 250
SIZE_PX = 1024
MEAN_BOUND_PX, MAX_BOUND_PX = 0.05, 0.15
# Corners of about 18 boards are found to some hundredths of a pixel. ξ and the focal length are
# correlated, so a calibration determines each less well than the pixels they predict.
XI_BOUND, FOCAL_BOUND_PERCENT, RMS_BOUND_PX = 0.002, 0.2, 0.1


def check_markers(fixture: Fixture, title: str) -> Section:
    """Render markers through the whole pipeline; compare their centroids with our model."""
    camera, measured, rims = marker_image(fixture)
    predicted = rim_centroids_px(camera.pixel_from_ray(rims).positions_px)
    off = np.linalg.norm(measured - predicted, axis=1)
    return Section(
        title,
        f"Centers of {len(off)} rendered white discs against their projections by the camera "
        "model. The discs have a radius of 0.8°, and are 0.6 to 12 m away all around a tilted "
        f"vehicle. The whole pipeline renders them at {SIZE_PX} × {SIZE_PX} px.",
        (
            Measure("markers, mean distance", mean_abs(off), "px", MEAN_BOUND_PX),
            Measure("markers, largest distance", max_abs(off), "px", MAX_BOUND_PX),
            Measure("markers", len(off)),
        ),
        figures=[CaptionedFigure("markers",
                 displacement_figure("Markers: measured − predicted", camera, predicted,
                                     measured - predicted),
                 "Error of each marker, × 300: errors are small, without a common direction.")],
    )  # fmt: skip


def check_omnidir(fixture: Fixture, title: str) -> Section:
    """Compare the markers' centroids with OpenCV's projection; calibrate it from chessboards."""
    camera, measured, rims = marker_image(fixture)
    projected = omnidir.project(camera, rims.reshape(-1, 3)).reshape(*rims.shape[:2], 2)
    off = np.linalg.norm(measured - rim_centroids_px(projected), axis=1)
    sensor = OmniCamera().with_polygons(None).resized(SIZE_PX)
    boards, corners = detected_boards(fixture, sensor, 10 if fixture.is_quick else 20)
    size = (camera.width_px, camera.height_px)
    calibrated = omnidir.calibrate(board_corners_m(), corners, size)
    focal = 100.0 * (calibrated.focal_length_px / camera.unified_focal_length_px - 1.0)
    center = np.linalg.norm(calibrated.principal_point_px - camera.principal_point_px)
    return Section(
        title,
        "Projections by cv2.omnidir.projectPoints with the camera's K and ξ, against the centers "
        "of the rendered markers. Then calibration by cv2.omnidir.calibrate from chessboards in "
        "rendered images, against the camera's ξ and focal length (stated "
        f"{camera.mirror.xi:.5f} and {camera.unified_focal_length_px:.3f} px, calibrated "
        f"{calibrated.xi:.5f} and {calibrated.focal_length_px:.3f} px).",
        (
            Measure("markers against omnidir, mean distance", mean_abs(off), "px", MEAN_BOUND_PX),
            Measure("markers against omnidir, largest distance", max_abs(off),
                    "px", MAX_BOUND_PX),
            Measure("calibration: error of ξ",
                    abs(calibrated.xi - camera.mirror.xi), bound=XI_BOUND),
            Measure("calibration: error of the focal length", abs(focal),
                    "%", FOCAL_BOUND_PERCENT),
            Measure("calibration: reprojection, RMS", calibrated.rms_px, "px", RMS_BOUND_PX),
            Measure("boards", calibrated.boards),
            Measure("calibration: distance of the principal point", float(center), "px"),
        ),
        figures=[CaptionedFigure("chessboards",
                 gallery({f"board {i + 1}": b for i, b in enumerate(boards[:6])}, 3),
                 "Six of the chessboards used by OpenCV's calibration.")],
    )  # fmt: skip


class MarkerImage(NamedTuple):
    """Markers measured in an image."""

    camera: HyperbolicCamera
    measured_px: Floats  # (n, 2) centers
    rims: Floats  # (n, corners, 3), optical frame


def marker_image(fixture: Fixture) -> MarkerImage:
    """Render and measure markers in all directions."""
    sensor = OmniCamera().with_polygons(None).resized(SIZE_PX)
    pose = poses.pose((3.0, -2.0, 1.1), roll_deg=4.0, pitch_deg=-7.0, yaw_deg=33.0)
    markers = Markers.around(sensor, pose, MARKERS)
    measured_px = markers.centers_px(linear_image(fixture.render(markers.scene, sensor, pose)))
    viewpoint_m = markers.world_from_optical[:3, 3]
    around_m = marker_rims(markers.positions_m, viewpoint_m) - viewpoint_m
    return MarkerImage(
        mirror_camera(sensor), measured_px, around_m @ markers.world_from_optical[:3, :3]
    )


# Chessboard corners in rendered images, against OpenCV's projection with the calibration file.
#
# There is one camera for each of OpenCV's camera models.


BOARDS_BOUND_PX = 0.1
MAX_FISHEYE_RAD = math.radians(80.0)  # near 90° cv2.fisheye divides by a vanishing depth
MIN_BOARDS = 3
# With one sample per texel the boards' edges are jagged, which alone shifts a corner by 0.1 px.
SAMPLES: Final = 4
TEXELS = 1.5


@dataclass(frozen=True)
class BoardCamera:
    """Camera and format of its calibration file."""

    name: str
    camera: CentralCamera
    format: str
    boards_up_to_rad: float  # maximum angle of the boards' centers from the axis


def board_cameras() -> tuple[BoardCamera, ...]:
    """One camera for each of OpenCV's models, with published parameters if there are any."""
    mirror = HyperbolicCamera.framed_on_rim(HyperbolicMirror(), 640, 640)
    narrow = math.radians(14.0)
    return (
        BoardCamera("pinhole", PerspectiveCamera.with_field_of_view(800, 600, math.radians(85.0)),
                    "opencv_pinhole", narrow),
        BoardCamera("pinhole with distortion",
                    UnifiedCamera(800, 600, (540.0, 538.5), (402.25, 297.0), 0.0,
                                  (-0.25, 0.07, 1e-3, -5e-4)),
                    "opencv_pinhole", narrow),
        BoardCamera("fisheye",  # TUM-VI cam0
                    KannalaBrandtCamera(512, 512, (190.97848, 190.97331), (254.93171, 256.89744),
                                        (3.4823894e-3, 7.150348e-4, -2.0532361e-3, 2.0293674e-4)),
                    "opencv_fisheye", math.radians(45.0)),
        BoardCamera("omnidir with distortion",  # KITTI-360 image_02, at half its size
                    UnifiedCamera(1400, 1400, (1336.322, 1335.788), (716.943, 705.764),
                                  2.213404750785489,
                                  (0.016798, 1.654877, 4.222e-4, 4.246e-4)).scaled(0.5),
                    "opencv_omnidir", math.radians(65.0)),
        BoardCamera("omnidir of a mirror", mirror, "opencv_omnidir", mirror.mirror.theta_max_rad),
    )  # fmt: skip


def check_boards(fixture: Fixture, title: str) -> Section:
    """Compare corners found in rendered images with OpenCV's projection of the true corners."""
    count = MIN_BOARDS if fixture.is_quick else 10
    measures, counts, shown = [], [], {}
    for board_camera in board_cameras():
        off, boards, image = _off_px(fixture, board_camera, count)
        rms = float(np.sqrt(np.mean(off**2))) if boards >= MIN_BOARDS else math.nan
        measures.append(
            Measure(f"{board_camera.name}: reprojection, RMS", rms, "px", BOARDS_BOUND_PX)
        )
        counts.append(Measure(f"{board_camera.name}: boards", boards))
        if image is not None:
            shown[board_camera.name] = image
    return Section(
        title,
        "Corners that OpenCV detects in rendered chessboards, against the true corners projected "
        "by OpenCV's functions. OpenCV reads the calibration file that omnisim writes in its "
        "format; nothing is fitted.",
        measures + counts,
        figures=[CaptionedFigure("boards", gallery(shown, 3),
                 "One board for each camera model of OpenCV.")],
    )  # fmt: skip


def _off_px(
    fixture: Fixture, board_camera: BoardCamera, count: int
) -> tuple[Floats, int, Bytes | None]:
    """Distances (n,) in px of detected from projected corners; number of boards; the last image."""
    camera = board_camera.camera
    is_mirror = isinstance(camera, HyperbolicCamera)
    poses = (
        board_poses(count)
        if is_mirror
        else board_poses_in_front(count, board_camera.boards_up_to_rad, camera.rig_from_optical)
    )
    offs, shown = [np.empty(0)], None
    sensor = OmniCamera(camera, polygons=None, samples=SAMPLES, texels_per_pixel=TEXELS)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "calibration.yaml"
        calibration_of(camera).save(path, board_camera.format)
        images = board_images(fixture, sensor, poses)
        for rig_from_board, image in zip(poses, images, strict=True):
            detected = omnidir.find_corners(np.ascontiguousarray(image[..., 1]), PATTERN)
            optical_from_board = camera.rig_from_optical.T @ rig_from_board[:3]
            points = board_corners_m() @ optical_from_board[:, :3].T + optical_from_board[:, 3]
            in_file = points @ omnidir.OMNIDIR_FROM_OPTICAL if is_mirror else points
            theta = np.arctan2(np.hypot(in_file[:, 0], in_file[:, 1]), in_file[:, 2])
            is_behind = board_camera.format == "opencv_fisheye" and theta.max() > MAX_FISHEYE_RAD
            if detected is None or is_behind:
                continue
            projected = omnidir.project_by_file(path, board_camera.format, in_file)
            columns, rows = PATTERN
            grid = detected.reshape(rows, columns, 2)
            orders = (grid, grid[::-1], grid[:, ::-1], grid[::-1, ::-1])  # the best one counts
            off = [np.linalg.norm(projected - order.reshape(-1, 2), axis=1) for order in orders]
            offs.append(min(off, key=np.sum))
            shown = image
    return np.concatenate(offs), len(offs) - 1, shown
