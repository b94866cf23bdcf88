"""Chessboard corners in rendered images, against OpenCV's projection with the calibration file.

There is one camera for each of OpenCV's camera models.
"""

from __future__ import annotations

import math
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Final

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
from omnisim.core.arrays import Bytes, Floats
from omnisim.plots.style import gallery
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import open_sensor
from omnisim.report.report import CaptionedFigure, Measure, Section
from omnisim.validation.fixture import Fixture
from omnisim.validation.oracles import omnidir
from omnisim.validation.plain_scenes import (
    PATTERN,
    board_corners_m,
    board_poses,
    board_poses_in_front,
    board_scene,
)

RMS_BOUND_PX = 0.1
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


def check(fixture: Fixture, title: str) -> Section:
    """Compare corners found in rendered images with OpenCV's projection of the true corners."""
    count = MIN_BOARDS if fixture.is_quick else 10
    measures, counts, shown = [], [], {}
    for board_camera in board_cameras():
        off, boards, image = _off_px(fixture, board_camera, count)
        rms = float(np.sqrt(np.mean(off**2))) if boards >= MIN_BOARDS else math.nan
        measures.append(Measure(f"{board_camera.name}: reprojection, RMS", rms, "px", RMS_BOUND_PX))
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
    """Distances between detected and projected corners, over the boards that OpenCV detects.

    Returns:
        Distances (n,) in px; number of boards; and the image of the last board, or None.
    """
    camera = board_camera.camera
    is_mirror = isinstance(camera, HyperbolicCamera)
    rig_from_optical = camera.rig_from_optical
    if is_mirror:
        poses = [rig_from_optical.T @ rig_from_board[:3] for rig_from_board in board_poses(count)]
    else:
        poses = board_poses_in_front(count, board_camera.boards_up_to_rad)
    offs, shown = [np.empty(0)], None
    sensor = OmniCamera(camera, polygons=None, samples=SAMPLES, texels_per_pixel=TEXELS)
    with (
        tempfile.TemporaryDirectory() as folder,
        open_sensor(board_scene(), sensor, unlit=True, device=fixture.device) as renderer,
    ):
        path = Path(folder) / "calibration.yaml"
        calibration_of(camera).save(path, board_camera.format)
        for optical_from_board in poses:
            rig_from_board = np.eye(4)
            rig_from_board[:3] = rig_from_optical @ optical_from_board[:3]
            image = renderer.render(np.linalg.inv(rig_from_board)).rgba
            detected = omnidir.find_corners(np.ascontiguousarray(image[..., 1]), PATTERN)
            points = board_corners_m() @ optical_from_board[:3, :3].T + optical_from_board[:3, 3]
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
            shown = image[..., :3]
    return np.concatenate(offs), len(offs) - 1, shown
