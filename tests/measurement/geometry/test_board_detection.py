"""Boards in images: corners where the lens puts them, and refusals of what is no such board."""

import numpy as np
import pytest

from omnisim.core.errors import MeasurementError
from omnisim.measurement.geometry import AprilGrid, CharucoBoard, Chessboard
from omnisim.measurement.geometry.board_detection import find_board, grid_fault, squares_fault
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

cv2 = pytest.importorskip("cv2")
BOARD = Chessboard(8, 6, 0.03)
ODD_BOARD = Chessboard(7, 6, 0.03)
CENTERED = np.array([-0.105, -0.075, 0.0])


def centered(pose, offset_m=CENTERED):
    moved = pose.copy()
    moved[:3, 3] += pose[:3, :3] @ offset_m
    return moved


@pytest.fixture(scope="module")
def pose():
    return centered(board_pose(40.0, 30.0, 0.4))


@pytest.fixture(scope="module")
def image(pose):
    return board_image(LENS, pose, chessboard_texture())


def test_corners_of_a_chessboard_lie_where_the_lens_shows_them(image, pose):
    found = find_board(image, BOARD)
    exact = seen_view(LENS, pose, corner_grid()).pixels_px
    turned = exact[::-1]  # this board looks the same after half a turn
    error = min(np.abs(found.pixels_px - one).max() for one in (exact, turned))
    assert error < 0.12  # 0.07 px where a square is 9 px wide; the samples of 4 × 4 leave 0.03
    bias = min(np.abs((found.pixels_px - one).mean(axis=0)).max() for one in (exact, turned))
    assert bias < 0.03


def test_a_board_with_black_and_white_corners_is_always_the_same_way_round(pose):
    turn = np.diag([-1.0, -1.0, 1.0, 1.0])
    turn[:2, 3] = 6 * 0.03, 5 * 0.03
    for stands in (pose, pose @ turn):
        found = find_board(board_image(LENS, stands, chessboard_texture(7, 6)), ODD_BOARD)
        exact = seen_view(LENS, stands, corner_grid(7, 6)).pixels_px
        assert np.abs(found.pixels_px - exact).max() < 0.15


def test_a_mirrored_camera_sees_the_board_from_its_other_side(image):
    flipped = np.ascontiguousarray(image[:, ::-1])
    found = find_board(flipped, BOARD, mirrored=True)
    straight = find_board(image, BOARD)
    mirrored_back = found.pixels_px * (-1.0, 1.0) + (LENS.width_px - 1.0, 0.0)
    assert np.abs(mirrored_back - straight.pixels_px).max() < 1e-4


@pytest.mark.parametrize("shape", [(1, 1), (9, 9), (15, 15), (17, 17), (200, 300)])
def test_an_even_image_has_no_board_however_tiny(shape):
    with pytest.raises(MeasurementError, match="no chessboard of 8 x 6 inner corners"):
        find_board(np.full(shape, 120, np.uint8), BOARD)


@pytest.mark.parametrize("size", [(5, 4), (7, 6), (9, 6)])
def test_another_board_is_named(image, size):
    seen = (
        "but of 8 x 6|squares continue beyond the board|do not alternate in color|no chessboard of"
    )
    with pytest.raises(MeasurementError, match=seen):
        find_board(image, Chessboard(*size, 0.03))


def test_corners_in_another_order_are_refused():
    grid = np.moveaxis(np.mgrid[:5, :6], 0, -1)[..., ::-1] * 20.0
    assert grid_fault(grid) is None
    swapped = grid.copy()
    swapped[2, [1, 2]] = swapped[2, [2, 1]]
    assert grid_fault(swapped) == "its corners do not form a grid"
    jumped = grid.copy()
    jumped[:, 3:] += (50.0, 0.0)
    assert grid_fault(jumped) == "its rows of corners are irregular"


def test_squares_of_one_color_are_refused():
    grid = np.moveaxis(np.mgrid[:5, :6], 0, -1)[..., ::-1] * 20.0 + 10.0
    row, column = np.mgrid[:130, :140]
    board = (((row - 10) // 20 + (column - 10) // 20) % 2 * 200 + 20).astype(np.uint8)
    assert squares_fault(board, grid) is None
    board[30:70, 30:90] = 220
    assert "do not alternate in color" in squares_fault(board, grid)


def test_charuco_corners_are_identified_though_some_are_hidden():
    board = CharucoBoard(7, 5, 0.03, 0.022, "5X5_100")
    pose = centered(board_pose(10.0, 15.0, 0.22, (0.2, 0.1, 0.2)))
    image = board_image(LENS, pose, charuco_texture())
    image[:, :150] = 128
    found = find_board(image, board)
    assert 12 <= len(found.points_m) < 24
    exact = seen_view(LENS, pose, found.points_m).pixels_px
    assert np.abs(found.pixels_px - exact).max() < 0.25  # markers lie 4 px beside the corners


def test_kalibr_grid_is_identified():
    board = AprilGrid(3, 2, 0.06, 0.3)
    pose = centered(board_pose(30.0, 10.0, 0.25, (0.1, 0.2, 0.1)), np.array([-0.108, 0.069, 0.0]))
    image = board_image(LENS, pose, april_grid_texture())
    found = find_board(image, board)
    assert 20 <= len(found.points_m) <= 24  # a tag's corner was off by 4 px
    exact = seen_view(LENS, pose, found.points_m).pixels_px
    errors = np.abs(found.pixels_px - exact).max(axis=1)
    assert np.quantile(errors, 0.9) < 0.15  # a tag's corner may end at a black square's
    with pytest.raises(MeasurementError, match="the mirrored image shows them: give --mirrored"):
        find_board(np.ascontiguousarray(image[:, ::-1]), board)
