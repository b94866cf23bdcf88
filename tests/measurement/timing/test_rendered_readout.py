"""Readout from a turning board, each of whose corners is seen when its own row is read out.

The corners are computed, or found in frames that the renderer's own rolling shutter exposes.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from omnisim.cameras import KannalaBrandtCamera
from omnisim.core.errors import MeasurementError
from omnisim.measurement.geometry import BoardView, Chessboard
from omnisim.measurement.geometry.board_detection import find_board
from omnisim.measurement.timing import measure_readout
from omnisim.rendering.camera.degradations import Degradation, Shutter
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import open_sensor
from omnisim.validation.plain_scenes import PATTERN, SQUARE_M, board_scene
from tests.measurement.geometry.board_pictures import LENS, board_pose, corner_grid

FRAME_RATE_HZ = 30.0
GRID = corner_grid()


def turning_views(readout_s, turn_dps=500.0, sigma_px=0.05, count=10, axis=1, wobble=0.1):
    """Board that turns about its middle, unevenly, with noisy corners; axis 1: rows are read."""
    random = np.random.default_rng(1)
    pose = board_pose(20.0, 15.0, 0.3)
    middle = GRID.mean(axis=0)
    points = np.column_stack((GRID - middle, np.zeros(len(GRID))))
    lines = (LENS.width_px, LENS.height_px)[axis] - 1.0
    views = []
    for number in range(count):
        shares = np.full(len(GRID), 0.5)
        for _ in range(30):  # the instant at which a corner's own row is read out
            times_s = number / FRAME_RATE_HZ + readout_s * (shares - 0.5)
            angles = np.radians(turn_dps) * times_s + wobble * np.sin(8.0 * times_s)
            turned = Rotation.from_rotvec(angles[:, None] * (0.1, -0.2, 1.0)).apply(points)
            pixels = LENS.pixel_from_ray(turned @ pose[:3, :3].T + pose[:3, 3]).positions_px
            shares = pixels[:, axis] / lines
        noisy = pixels + sigma_px * random.normal(size=pixels.shape)
        views.append(BoardView(f"{number}.png", GRID, noisy))
    return views


def measured_from(views, frames=None):
    return measure_readout(LENS, views, frames or range(len(views)), FRAME_RATE_HZ)


@pytest.mark.parametrize("axis", [1, 0], ids=["rows", "columns"])
def test_the_readout_is_right_to_a_percent_from_ten_frames(axis):
    measured = measured_from(turning_views(0.021, axis=axis))
    (readout, *_) = measured.quantities
    assert measured.lines == ("columns", "rows")[axis]
    assert measured.readout_s == pytest.approx(0.021, rel=0.01)
    assert abs(readout.value - 0.021) < 3.0 * readout.sigma < 0.02 * 0.021
    rms_px, frozen_px = (
        np.sqrt(np.mean(np.square(errors))) for errors in (measured.errors_px, measured.frozen_px)
    )
    assert rms_px < 0.05 < 3.0 * rms_px < frozen_px


def test_frames_without_a_board_leave_a_gap():
    views = turning_views(0.021, turn_dps=300.0, count=12)
    kept = [0, 1, 2, 4, 5, 6, 8, 9, 10, 11]
    measured = measured_from([views[index] for index in kept], kept)
    assert measured.readout_s == pytest.approx(0.021, rel=0.02)


def test_corners_found_from_the_other_end_are_the_same_board():
    views = turning_views(0.021)
    for index in (3, 4, 7):
        views[index] = BoardView(f"{index}.png", GRID, views[index].pixels_px[::-1])
    assert measured_from(views).readout_s == pytest.approx(0.021, rel=0.01)


def test_a_global_shutter_and_a_readout_from_below_are_told_apart():
    assert measured_from(turning_views(0.0)).readout_s == 0.0
    upward = measured_from(turning_views(-0.021))
    assert upward.readout_s == pytest.approx(0.021, rel=0.015)
    assert "readout_direction" in {one.name for one in upward.unobservable}


@pytest.mark.parametrize(
    ("views", "message"),
    [
        (turning_views(0.02, count=4), "4 images with a board: expected at least 5"),
        (turning_views(0.02, turn_dps=900.0), "to the next image: expected at most 25°"),
        (turning_views(0.02, turn_dps=5.0, wobble=0.0), "determines the readout only to"),
    ],
)
def test_boards_that_do_not_determine_it_are_refused(views, message):
    with pytest.raises(MeasurementError, match=message):
        measured_from(views)


RENDERED_LENS = KannalaBrandtCamera(
    320, 240, (210.0, 210.4), (160.8, 118.5), (0.012, -0.008, 0.002, -0.0005), np.radians(44.0)
)
READOUT_S, EXPOSURE_S, FRAMES = 0.021, 0.002, 8
SUB_FRAMES = 23  # of 1 ms: each row averages two of them


def base_pose(time_s):
    """Pose (4, 4) of the camera before the board, which turns about its axis, unevenly."""
    turn = np.radians(300.0) * time_s + 0.06 * np.sin(9.0 * time_s)
    optical_from_board = np.eye(4)
    optical_from_board[:3, :3] = Rotation.from_euler("zyx", (turn, 0.25, -0.2)).as_matrix()
    optical_from_board[:3, 3] = 0.02 + 0.1 * time_s, 0.03, 0.85
    rig_from_board = np.eye(4)
    rig_from_board[:3] = RENDERED_LENS.rig_from_optical @ optical_from_board[:3]
    return np.linalg.inv(rig_from_board)


def rendered_views(shutter):
    sensor = OmniCamera(RENDERED_LENS, degradation=Degradation(shutter=shutter))
    views = []
    with open_sensor(board_scene(), sensor, unlit=True) as renderer:
        for number in range(FRAMES):
            time_s = number / FRAME_RATE_HZ
            frame = renderer.render(
                base_pose(time_s), motion=lambda later_s, now_s=time_s: base_pose(now_s + later_s)
            )
            image = np.ascontiguousarray(frame.rgba[..., 1])
            views.append(find_board(image, Chessboard(*PATTERN, SQUARE_M), f"{number}.png"))
    return views


@pytest.mark.slow
def test_the_readout_of_rendered_frames_is_right_to_a_percent():
    pytest.importorskip("cv2")
    shutter = Shutter(exposure_s=EXPOSURE_S, readout_s=READOUT_S, sub_frames=SUB_FRAMES)
    measured = measure_readout(RENDERED_LENS, rendered_views(shutter), range(FRAMES), FRAME_RATE_HZ)
    assert measured.lines == "rows"
    assert measured.readout_s == pytest.approx(READOUT_S, rel=0.01)
    assert "readout_direction" not in {one.name for one in measured.unobservable}
