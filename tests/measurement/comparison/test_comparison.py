"""A camera's images beside its twin's: the true twin matches, a wrong one does not."""

import dataclasses

import numpy as np
import pytest
from scipy.special import ndtr

from omnisim.cameras import KannalaBrandtCamera, MirroredCamera
from omnisim.core.errors import MeasurementError
from omnisim.measurement.comparison import BoardSurface, compare_images, locate_board
from omnisim.measurement.comparison.comparison import compare_image, edge_rise_px
from omnisim.measurement.comparison.twin_board import BoardPatches, fit_light
from omnisim.measurement.geometry import AprilGrid, BoardView, CharucoBoard, Chessboard
from omnisim.measurement.geometry.board_detection import find_board
from omnisim.rendering.camera.degradations import Degradation, Encoding
from omnisim.rendering.camera.omnicamera import OmniCamera
from tests.measurement.geometry.board_pictures import (
    LENS,
    april_grid_texture,
    board_image,
    board_pose,
    charuco_texture,
    chessboard_texture,
    corner_grid,
    seen_view,
)

BOARD = Chessboard(8, 6, 0.03)
TELEPHOTO = KannalaBrandtCamera(360, 280, (330.0, 331.0), (180.0, 139.0), LENS.coefficients)
MIDDLE = (-0.105, -0.075, 0.0)


def centered(*arguments):
    pose = board_pose(*arguments)
    pose[:3, 3] += pose[:3, :3] @ MIDDLE
    return pose


def test_a_board_is_located_where_it_stands():
    pose = centered(40.0, 30.0, 0.4)
    found = locate_board(LENS, seen_view(LENS, pose, corner_grid()))
    assert np.abs(found.pose - pose).max() < 1e-6


def test_a_board_behind_a_mirror_is_located_where_it_stands():
    camera = MirroredCamera(LENS)
    pose = centered(40.0, 30.0, 0.4)
    mirrored = pose.copy()
    mirrored[2] *= -1.0  # behind the mirror, and turned to it
    points = np.column_stack((corner_grid(), np.zeros(48)))
    seen = camera.pixel_from_ray(points @ mirrored[:3, :3].T + mirrored[:3, 3])
    located = locate_board(camera, BoardView("a", corner_grid(), seen.positions_px)).pose
    assert np.linalg.det(located[:3, :3]) == pytest.approx(1.0)
    assert np.abs(located[:3, [0, 1, 3]] - mirrored[:3, [0, 1, 3]]).max() < 1e-6


def test_a_bent_board_continues_beyond_its_measured_corners():
    x, y = corner_grid().T
    bow = 0.002 * (1.0 - ((x - 0.105) ** 2 + (y - 0.075) ** 2) / 0.13**2)
    measured = np.column_stack((x + 1e-4, y, bow))[np.random.default_rng(1).permutation(48)]
    surface = BoardSurface.measured(measured[4:], corner_grid())  # some corners were never seen
    places = np.array([[0.105, 0.075], [0.045, 0.045], [-0.03, -0.03], [0.24, 0.18]])
    points = surface.points(places)
    assert np.allclose(points[:, 0], places[:, 0] + 1e-4, atol=1e-6)
    squared = np.square(places - (0.105, 0.075)).sum(axis=1)
    errors = points[:, 2] - 0.002 * (1.0 - squared / 0.13**2)
    assert np.abs(errors[:2]).max() < 1e-5  # between the corners
    assert np.abs(errors[2:]).max() < 1e-3  # a square beyond them, where a plane is 1.5 mm off
    assert not BoardSurface.flat().points(places)[:, 2].any()


def test_fitted_light_leaves_the_noise_of_squares():
    random = np.random.default_rng(2)
    y, x = np.mgrid[-1:1:5j, -1:1:7j]
    is_black = (np.indices(x.shape).sum(axis=0) % 2 == 0).ravel()
    positions = np.stack((x.ravel(), y.ravel()), axis=1)
    true = (0.6 + 0.1 * x - 0.05 * y * y).ravel() * np.where(is_black, 0.1, 1.0)
    squares = np.concatenate((positions - 0.2, positions + 0.2), axis=1)
    measured = true + 0.002 * random.normal(size=true.shape)
    measured[11] += 0.3  # clipped, and so left out
    is_used = np.arange(35) != 11
    light = fit_light(BoardPatches(squares, squares, is_black), measured, is_used)
    assert np.abs(light.at(positions, is_black) - true).max() < 0.006


@pytest.fixture(scope="module")
def pictures():
    pytest.importorskip("cv2")
    pictures = []
    for place in ((40.0, 20.0, 0.3), (160.0, 35.0, 0.35), (280.0, 45.0, 0.35)):
        image = board_image(LENS, centered(*place), chessboard_texture())
        pictures.append((find_board(image, BOARD, f"{len(pictures)}.png"), image))
    return pictures


def _compared(sensor, pictures, board=BOARD):
    pytest.importorskip("cv2")
    return compare_images(sensor, [compare_image(sensor, board, *picture) for picture in pictures])


@pytest.mark.slow
def test_the_true_twin_shows_the_same_corners_edges_and_levels(pictures):
    compared = _compared(OmniCamera(LENS), pictures)
    assert compared.lost == 0
    assert compared.bias_px < 0.05
    assert np.percentile(np.abs(compared.level_errors), 90.0) <= 4.0
    for ring in compared.rings:
        assert ring.twin_rise_px == pytest.approx(ring.rise_px, rel=0.15)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("board", "texture", "middle_m"),
    [
        (CharucoBoard(7, 5, 0.03, 0.022, "5X5_100"), charuco_texture, (-0.105, -0.075, 0.0)),
        (AprilGrid(3, 2, 0.06, 0.3), lambda: april_grid_texture(1), (-0.108, 0.069, 0.0)),
    ],
    ids=["charuco", "april_grid"],
)
def test_boards_with_markers_are_shown_with_the_same_corners_edges_and_levels(
    board, texture, middle_m
):
    pytest.importorskip("cv2")
    pose = board_pose(30.0, 3.0, 0.27, (0.1, 0.2, 0.1))
    pose[:3, 3] += pose[:3, :3] @ middle_m
    image = board_image(TELEPHOTO, pose, texture())
    view = find_board(image, board, "a.png")
    # the image mixes levels, not light: sRGB would move the corners of markers by 0.1 px
    sensor = OmniCamera(TELEPHOTO, degradation=Degradation(encoding=Encoding(gamma=1.0)))
    compared = _compared(sensor, [(view, image)], board)
    assert compared.lost == 0
    assert compared.bias_px < 0.05
    difference = compared.images[0].twin.astype(np.float64) - image
    near = np.zeros(image.shape, dtype=bool)
    low, high = np.floor(view.pixels_px.min(axis=0)), np.ceil(view.pixels_px.max(axis=0))
    near[int(low[1]) : int(high[1]), int(low[0]) : int(high[0])] = True
    assert np.sqrt(np.mean(np.square(difference[near]))) < 8.0  # another tag or turn: above 50
    assert np.abs(compared.level_errors).max() <= 1.0
    for ring in compared.rings:
        assert ring.twin_rise_px == pytest.approx(ring.rise_px, rel=0.15)


@pytest.mark.slow
def test_a_wrong_twin_shows_them_elsewhere(pictures):
    wrong = dataclasses.replace(LENS, coefficients=(0.05, -0.012, 0.004, -0.001))
    compared = _compared(OmniCamera(wrong), pictures)
    assert max(ring.rms_px for ring in compared.rings) > 0.15 or compared.lost


def test_an_image_of_another_size_is_refused(pictures):
    view, image = pictures[0]
    with pytest.raises(MeasurementError, match="400 × 300 px, but the sensor has 360 × 360"):
        compare_image(OmniCamera(), BOARD, view, image)


def _edge(sigma_px, slope=0.2, black=30.0, white=220.0):
    """Image (60, 60) of an edge through its middle, blurred by a Gaussian, averaged over pixels."""
    at = np.arange(480) / 8.0 - 0.4375 - 29.5
    levels = ndtr((at + slope * at[:, None]) / np.hypot(1.0, slope) / sigma_px)
    levels = levels.reshape(60, 8, 60, 8).mean(axis=(1, 3))
    return np.rint(black + (white - black) * levels).astype(np.uint8)


@pytest.mark.parametrize(("sigma_px", "slope"), [(0.5, -0.4), (0.8, 0.2), (1.5, -0.4)])
def test_rise_of_a_gaussian_edge(sigma_px, slope):
    along = np.array([-slope, 1.0]) / np.hypot(1.0, slope) * 20.0
    rise = edge_rise_px(_edge(sigma_px, slope), 29.5 - along, 29.5 + along)
    expected = 2.5631 * np.hypot(sigma_px, np.sqrt(1.0 / 12.0))  # 10-90 % of a Gaussian and a pixel
    assert rise == pytest.approx(expected, rel=0.05)  # the bins of 0.25 px widen it by 0.01 px


def test_faint_and_short_edges_have_no_rise():
    ends = np.array([29.5, 10.0]), np.array([29.5, 50.0])
    assert np.isnan(edge_rise_px(_edge(1.0, 0.0, 100.0, 110.0), *ends))
    assert np.isnan(edge_rise_px(_edge(1.0, 0.0), ends[0], ends[0] + (0.0, 4.0)))
