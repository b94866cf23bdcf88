"""OpenCV's omnidir against rendered images: projection with our K and ξ, and its calibration."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from omnisim.cameras import HyperbolicCamera
from omnisim.core import coordinate_frames as frames
from omnisim.core import poses
from omnisim.core.arrays import Floats
from omnisim.plots.style import gallery
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.report.report import CaptionedFigure, Measure, Section
from omnisim.validation import markers
from omnisim.validation.fixture import Fixture, linear_image, max_abs, mean_abs, mirror_camera
from omnisim.validation.image_differences import displacement_figure
from omnisim.validation.oracles import omnidir
from omnisim.validation.plain_scenes import board_corners_m, detected_boards

MARKERS = 250
SIZE_PX = 1024
MEAN_BOUND_PX, MAX_BOUND_PX = 0.05, 0.15
# Corners of about 18 boards are found to some hundredths of a pixel. ξ and the focal length are
# correlated, so a calibration determines each less well than the pixels they predict.
XI_BOUND, FOCAL_BOUND_PERCENT, RMS_BOUND_PX = 0.002, 0.2, 0.1


def check_markers(fixture: Fixture, title: str) -> Section:
    """Render markers through the whole pipeline; compare their centroids with our model."""
    camera, measured, rims = marker_image(fixture)
    predicted = markers.rim_centroids_px(camera.pixel_from_ray(rims).positions_px)
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
    off = np.linalg.norm(measured - markers.rim_centroids_px(projected), axis=1)
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
            Measure("calibration: ξ, distance from the stated one",
                    abs(calibrated.xi - camera.mirror.xi), bound=XI_BOUND),
            Measure("calibration: focal length, distance from the stated one", abs(focal),
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
    camera = mirror_camera(sensor)
    world_from_base = poses.pose((3.0, -2.0, 1.1), roll_deg=4.0, pitch_deg=-7.0, yaw_deg=33.0)
    world_from_rig = world_from_base @ sensor.base_from_rig
    world_from_optical = world_from_rig[:3, :3] @ frames.RIG_FROM_OPTICAL_LOOKING_UP
    viewpoint_m = world_from_rig[:3, 3]
    axis = -world_from_optical[:, 2]  # from the mirror toward the pinhole
    positions = markers.marker_positions(viewpoint_m, axis, camera.mirror.theta_max_rad, MARKERS)
    near_px = camera.pixel_from_ray((positions - viewpoint_m) @ world_from_optical).positions_px
    clear = markers.inside_valid_area(camera, near_px)
    frame = fixture.render(
        markers.marker_scene(positions[clear], viewpoint_m), sensor, world_from_base
    )
    measured = markers.centroids(linear_image(frame)[..., 1].astype(np.float64), near_px[clear])
    around = (markers.marker_rims(positions[clear], viewpoint_m) - viewpoint_m) @ world_from_optical
    return MarkerImage(camera, measured, around)
