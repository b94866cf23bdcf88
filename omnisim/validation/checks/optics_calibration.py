"""Calibration from chessboards in the paper's mirror, aligned and not, by OpenCV and by omnisim."""

from __future__ import annotations

from typing import Any

import numpy as np

from omnisim.cameras import MirroredCamera
from omnisim.cameras.optics import BoardCorners, calibrate_system, fit_central
from omnisim.cameras.optics.system_file import parse_optics
from omnisim.plots.style import gallery
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.report.report import CaptionedFigure, Measure, ResultTable, Section
from omnisim.validation.fixture import Fixture
from omnisim.validation.oracles import omnidir
from omnisim.validation.plain_scenes import DetectedBoards, board_corners_m, detected_boards

SIZE_PX = 720
BOARDS, QUICK_BOARDS = 20, 10
TILT_DEG, SHIFT_M = 2.0, 0.002
BOARD_M = 0.7  # approximate distance from the mirror
# Corners are detected to a tenth of a pixel: the mirror bends their edges.
RMS_BOUND_PX = 0.15
# Four standard deviations for ten boards; the position along the axis correlates with distances.
TILT_BOUND_DEG, SHIFT_BOUND_MM, ALONG_BOUND_MM = 0.05, 0.03, 0.2
CENTER_BOUND_PX = 2.0  # the principal point correlates with focal length, ξ and distortion
_ASIDE = ("surfaces.0.decenter_m.0", "surfaces.0.decenter_m.1")
_ALONG = "surfaces.0.decenter_m.2"
_TILTS = ("surfaces.0.tilt_deg.0", "surfaces.0.tilt_deg.1")
_PARAMETERS = (*_ASIDE, _ALONG, *_TILTS)


def check(fixture: Fixture, title: str) -> Section:
    """Calibrate from the same boards through the aligned and the misaligned mirror."""
    size = (SIZE_PX, SIZE_PX)
    aligned, tilted = (
        boards_in_mirror(fixture, mirror_table(*misalignment))
        for misalignment in ((0.0, 0.0), (TILT_DEG, SHIFT_M))
    )
    points_m = board_corners_m()
    plain = omnidir.calibrate(points_m, aligned.corners, size)
    tilted_plain = omnidir.calibrate(points_m, tilted.corners, size)
    distorted = omnidir.calibrate(points_m, tilted.corners, size, distorted=True)
    central = fit_central(
        parse_optics(mirror_table(TILT_DEG, SHIFT_M)), "opencv_omnidir", right_at_m=BOARD_M
    ).cameras[0]
    assert isinstance(central.camera, MirroredCamera)
    center_px = np.linalg.norm(distorted.principal_point_px - central.camera.principal_point_px)
    fits = []
    for detected in (aligned, tilted):
        boards = [BoardCorners(points_m[:, :2], corners) for corners in detected.corners]
        fits.append(calibrate_system(mirror_table(0.0, 0.0), _PARAMETERS, boards))
    rms_px = [float(np.sqrt(np.square(fit.errors_px).sum(axis=1).mean())) for fit in fits]
    rows, errors = [], dict.fromkeys(_PARAMETERS, 0.0)
    for name, fit, tilt_deg, shift_m in (
        ("aligned", fits[0], 0.0, 0.0),
        ("misaligned", fits[1], TILT_DEG, SHIFT_M),
    ):
        truths = dict.fromkeys(_PARAMETERS, 0.0) | {_TILTS[0]: tilt_deg, _ASIDE[0]: shift_m}
        for fitted in fit.parameters:
            key, value = fitted.name, fitted.value
            errors[key] = max(errors[key], abs(value - truths[key]))
            rows.append((name, key, f"{truths[key]:g}", f"{value:.6f}", f"{fitted.sigma:.6f}"))
    return Section(
        title,
        "Calibrations from chessboards seen in the paper's mirror, once aligned, once tilted by "
        f"{TILT_DEG:g}° and offset by {1e3 * SHIFT_M:g} mm, at {SIZE_PX} × {SIZE_PX} px, with "
        "corners detected by OpenCV. cv2.omnidir calibrates the nearest central camera. Without "
        "distortion, its residual shows the misalignment; with distortion, its principal point is "
        "that of omnisim's central fit. Least squares over the mirror's pose, starting at the "
        "aligned pose, recover the misalignment.",
        (
            Measure("aligned, cv2.omnidir: reprojection, RMS", plain.rms_px, "px", RMS_BOUND_PX),
            Measure("misaligned, cv2.omnidir without distortion, RMS", tilted_plain.rms_px, "px"),
            Measure("misaligned, cv2.omnidir with distortion, RMS", distorted.rms_px, "px",
                    RMS_BOUND_PX),
            Measure("principal point: our central fit from cv2.omnidir's", float(center_px), "px",
                    CENTER_BOUND_PX),
            Measure("the mirror's own pose: reprojection, RMS", max(rms_px), "px",
                    RMS_BOUND_PX),
            Measure("tilt found, largest error", max(errors[key] for key in _TILTS), "°",
                    TILT_BOUND_DEG),
            Measure("shift aside found, largest error", 1e3 * max(errors[key] for key in _ASIDE),
                    "mm", SHIFT_BOUND_MM),
            Measure("shift along the axis found, largest error", 1e3 * errors[_ALONG], "mm",
                    ALONG_BOUND_MM),
            Measure("boards", len(aligned.corners) + len(tilted.corners)),
        ),
        (ResultTable("The mirror's pose by least squares, in meters and degrees.",
                     ("mirror", "parameter", "true", "found", "σ"), tuple(rows)),),
        figures=[CaptionedFigure("optics-chessboards",
                 gallery({f"board {i + 1}": b for i, b in enumerate(tilted.images[:6])}, 3),
                 "Six of the chessboards seen in the misaligned mirror.")],
    )  # fmt: skip


def mirror_table(tilt_deg: float, shift_m: float) -> dict[str, Any]:
    """Table of an optics file with the paper's mirror, tilted about x and shifted along x."""
    camera = {
        "model": "perspective",
        "width_px": SIZE_PX,
        "height_px": SIZE_PX,
        "focal_length_px": 1330.0 / 360.0 * SIZE_PX,
    }
    mirror = {
        "shape": "hyperbolic",
        "rim_radius_m": 0.0119,
        "decenter_m": [shift_m, 0.0, 0.0],
        "tilt_deg": [tilt_deg, 0.0, 0.0],
    }
    return {"origin_m": [0.0, 0.0, 0.09284], "camera": camera, "surfaces": [mirror]}


def boards_in_mirror(fixture: Fixture, table: dict[str, Any]) -> DetectedBoards:
    """Render the boards through a mirror, and detect their corners."""
    count = QUICK_BOARDS if fixture.is_quick else BOARDS
    return detected_boards(fixture, OmniCamera(parse_optics(table)), count)
