"""Readout from a turning board: each corner is seen when its own row is read out."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from omnisim.core.errors import MeasurementError
from omnisim.measurement.geometry import BoardView
from omnisim.measurement.timing import measure_readout
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
    readout = measured.quantities[0]
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
        one = views[index]
        views[index] = BoardView(one.name, one.points_m, one.pixels_px[::-1])
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
