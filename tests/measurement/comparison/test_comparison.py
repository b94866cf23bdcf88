"""A camera's images beside its twin's: the true twin matches, a wrong one does not."""

import dataclasses

import numpy as np
import pytest

from omnisim.cameras import MirroredCamera
from omnisim.core.errors import MeasurementError
from omnisim.measurement.comparison import compare_images, locate_board
from omnisim.measurement.comparison.comparison import compare_image
from omnisim.measurement.comparison.twin_board import board_grid_m, even_light
from omnisim.measurement.geometry import BoardView, Chessboard
from omnisim.measurement.geometry.board_detection import find_board
from omnisim.rendering.camera.omnicamera import OmniCamera
from tests.measurement.geometry.board_pictures import (
    LENS,
    board_image,
    board_pose,
    chessboard_texture,
    corner_grid,
    seen_view,
)

BOARD = Chessboard(8, 6, 0.03)
MIDDLE = (-0.105, -0.075, 0.0)


def centered(*arguments):
    pose = board_pose(*arguments)
    pose[:3, 3] += pose[:3, :3] @ MIDDLE
    return pose


def test_a_board_is_located_where_it_stands():
    pose = centered(40.0, 30.0, 0.4)
    found = locate_board(LENS, seen_view(LENS, pose, corner_grid()))
    assert np.abs(found.poses[0] - pose).max() < 1e-6
    assert found.rms_px < 1e-6


def test_a_board_behind_a_mirror_is_located_where_it_stands():
    camera = MirroredCamera(LENS)
    pose = centered(40.0, 30.0, 0.4)
    mirrored = pose.copy()
    mirrored[2] *= -1.0  # behind the mirror, and turned to it
    points = np.column_stack((corner_grid(), np.zeros(48)))
    seen = camera.pixel_from_ray(points @ mirrored[:3, :3].T + mirrored[:3, 3])
    located = locate_board(camera, BoardView("a", corner_grid(), seen.positions_px)).poses[0]
    assert np.linalg.det(located[:3, :3]) == pytest.approx(1.0)
    assert np.abs(located[:3, [0, 1, 3]] - mirrored[:3, [0, 1, 3]]).max() < 1e-6


def test_outer_squares_continue_the_measured_corners():
    measured = np.column_stack((corner_grid(), np.zeros(48)))
    measured = measured[np.lexsort((measured[:, 1], measured[:, 0]))]
    flat, from_measured = board_grid_m(BOARD, None), board_grid_m(BOARD, measured)
    assert flat.shape == (10, 12, 3)
    assert np.allclose(flat, from_measured)
    assert np.allclose(flat[0, 0], (-0.06, -0.06, 0.0))


def test_even_light_leaves_the_noise_of_squares():
    random = np.random.default_rng(2)
    y, x = np.mgrid[-1:1:5j, -1:1:7j]
    is_black = np.indices(x.shape).sum(axis=0) % 2 == 0
    true = (0.6 + 0.1 * x - 0.05 * y * y) * np.where(is_black, 0.1, 1.0)
    light = even_light(true + 0.002 * random.normal(size=true.shape), is_black)
    assert np.abs(light - true).max() < 0.006


@pytest.fixture(scope="module")
def pictures():
    poses = [
        centered(*values)
        for values in ((40.0, 20.0, 0.3), (160.0, 35.0, 0.35), (280.0, 45.0, 0.35))
    ]
    images = [board_image(LENS, pose, chessboard_texture()) for pose in poses]
    return [(find_board(image, BOARD, f"{index}.png"), image) for index, image in enumerate(images)]


@pytest.mark.slow
def test_the_true_twin_shows_the_same_corners_edges_and_levels(pictures):
    pytest.importorskip("cv2")
    sensor = OmniCamera(LENS)
    compared = compare_images(
        sensor, [compare_image(sensor, BOARD, view, image) for view, image in pictures]
    )
    assert compared.lost == 0
    assert compared.bias_px < 0.05
    assert np.percentile(np.abs(compared.level_errors), 90.0) <= 4.0
    for ring in compared.rings:
        assert ring.twin_rise_px == pytest.approx(ring.rise_px, rel=0.15)


@pytest.mark.slow
def test_a_wrong_twin_shows_them_elsewhere(pictures):
    pytest.importorskip("cv2")
    wrong = dataclasses.replace(LENS, coefficients=(0.05, -0.012, 0.004, -0.001))
    sensor = OmniCamera(wrong)
    compared = compare_images(
        sensor, [compare_image(sensor, BOARD, view, image) for view, image in pictures]
    )
    assert max(ring.rms_px for ring in compared.rings) > 0.15 or compared.lost


def test_an_image_of_another_size_is_refused(pictures):
    view, image = pictures[0]
    with pytest.raises(MeasurementError, match="400 × 300 px, but the sensor has 360 × 360"):
        compare_image(OmniCamera(), BOARD, view, image)
