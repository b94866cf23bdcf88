"""Calibration of optical systems from corners: what is put in comes out, and its errors hold."""

import copy

import numpy as np
import pytest

from omnisim.cameras.optics import calibrate_system
from omnisim.cameras.optics.centrality import CentralView
from omnisim.cameras.optics.system_calibration import (
    BoardCorners,
    FreeParameters,
    _Problem,
    first_pose,
    read_corners,
    write_corners,
)
from omnisim.cameras.optics.system_file import parse_optics
from omnisim.core import poses
from omnisim.core.errors import OpticsError

CAMERA = {"model": "perspective", "width_px": 360, "height_px": 360, "focal_length_px": 1000.0}
BALL = {
    "camera": CAMERA,
    "surfaces": [{"shape": "sphere", "radius_m": 0.03, "position_m": [0.0, 0.0, 0.15]}],
}
MIRROR = {
    "camera": CAMERA | {"focal_length_px": 1330.0},
    "surfaces": [{"shape": "hyperbolic", "rim_radius_m": 0.0119}],
}
PORT = {
    "camera": {
        "model": "equidistant", "width_px": 360, "height_px": 360, "focal_length_px": 110.0,
        "theta_max_deg": 80.0,
    },
    "surfaces": [
        {"shape": "port", "thickness_m": 0.01, "medium": "water", "position_m": [0, 0, 0.05]}
    ],
}  # fmt: skip
SYSTEMS = {
    "ball": (BALL, {"decenter_m": [0.001, -0.0007, 0.002]}, "surfaces.0.decenter_m"),
    "mirror": (
        MIRROR,
        {"decenter_m": [0.0008, -0.0005, 0.0006], "tilt_deg": [1.2, -0.7, 0.0]},
        "surfaces.0.decenter_m,surfaces.0.tilt_deg.0,surfaces.0.tilt_deg.1",
    ),
    "port": (
        PORT,
        {"position_m": [0.0, 0.0, 0.053], "tilt_deg": [1.5, 0.8, 0.0]},
        "surfaces.0.position_m.2,surfaces.0.tilt_deg.0,surfaces.0.tilt_deg.1",
    ),
}
GRID_M = 0.05 * np.stack(np.meshgrid(np.arange(-3.0, 4.0), np.arange(-2.0, 3.0)), -1).reshape(-1, 2)


def _changed(table, changes):
    table = copy.deepcopy(table)
    table["surfaces"][0].update(changes)
    return table


def boards_of(system, count=6, seed=5):
    """Corners of a board in front of pixels of the image, tilted."""
    generator = np.random.default_rng(seed)
    boards, middle = [], 0.5 * np.array([system.width_px - 1, system.height_px - 1])
    while len(boards) < count:
        angle, share = 2.4 * len(boards), generator.uniform(0.35, 0.6)
        pixel = middle * (1.0 + share * np.array([np.cos(angle), np.sin(angle)]))
        rays = system.rays(pixel[None])
        forward = rays.directions[0]
        side = np.cross(forward, (0.3, 0.5, 0.8))
        side /= np.linalg.norm(side)
        pose = np.eye(4)
        pose[:3, :3] = np.stack((side, np.cross(forward, side), forward), axis=1)
        roll_deg, pitch_deg, yaw_deg = generator.uniform(-25, 25, 3)
        turn = poses.pose(roll_deg=roll_deg, pitch_deg=pitch_deg, yaw_deg=yaw_deg)
        pose[:3, :3] @= turn[:3, :3]
        pose[:3, 3] = rays.origins_m[0] + generator.uniform(0.3, 0.6) * forward
        points_m = np.column_stack((GRID_M, np.zeros(len(GRID_M)))) @ pose[:3, :3].T + pose[:3, 3]
        seen = system.pixel_from_point(points_m)
        boards.append(BoardCorners(GRID_M[seen.valid], seen.positions_px[seen.valid]))
    return boards


@pytest.mark.parametrize("name", SYSTEMS)
def test_misalignment_is_found(name):
    table, changes, keys = SYSTEMS[name]
    truth = _changed(table, changes)
    found = calibrate_system(table, keys.split(","), boards_of(parse_optics(truth), 4))
    assert np.abs(found.before_px).max() > 0.1
    assert np.abs(found.errors_px).max() < 1e-6
    expected = FreeParameters(truth, keys.split(","), "truth").values
    values = [parameter.value for parameter in found.parameters]
    np.testing.assert_allclose(values, expected, atol=1e-6)
    rays, exact = (system.rays([[100.0, 120.0]]) for system in (found.system, parse_optics(truth)))
    np.testing.assert_allclose(rays.directions, exact.directions, atol=1e-8)


@pytest.mark.slow
def test_standard_deviations_are_those_of_the_errors():
    """Fits to different noise spread as each of them says."""
    table, changes, _ = SYSTEMS["ball"]
    system, keys = parse_optics(_changed(table, changes)), ["surfaces.0.decenter_m"]
    fits = [calibrate_system(table, keys, boards).parameters for boards in _noisy(system, 8)]
    values = np.array([[one.value for one in fit] for fit in fits])
    sigmas = np.array([[one.sigma for one in fit] for fit in fits])
    ratio = values.std(axis=0, ddof=1) / sigmas.mean(axis=0)
    # of 8 samples χ² with 7 degrees of freedom: 0.29 to 1.86 with a probability of 99.8 %
    assert ((ratio > 0.29) & (ratio < 1.86)).all()
    assert np.abs(values.mean(axis=0) - changes["decenter_m"]).max() < 4.0 * sigmas.max() / 8**0.5


def _noisy(system, count):
    """The same boards, each time with other noise of 0.1 px."""
    generator, boards = np.random.default_rng(8), boards_of(system, 2)
    for _ in range(count):
        noise = [generator.normal(0, 0.1, board.pixels_px.shape) for board in boards]
        pairs = zip(boards, noise, strict=True)
        yield [BoardCorners(one.points_m, one.pixels_px + more) for one, more in pairs]


@pytest.mark.parametrize("name", SYSTEMS)
def test_derivatives(name):
    """Against central differences of the errors themselves."""
    table, _, keys = SYSTEMS[name]
    system = parse_optics(table)
    boards = boards_of(system, 2)
    viewpoint_m = CentralView(system).viewpoint_m
    start = np.stack([first_pose(system, viewpoint_m, board) for board in boards])
    parameters = FreeParameters(table, keys.split(","), "system")
    problem = _Problem(parameters, boards, start)
    moves = np.random.default_rng(2).normal(0.0, 0.01, 12)
    vector = np.concatenate((parameters.values, moves))
    jacobian = problem.jacobian(vector)
    for index, column in enumerate(jacobian.T):
        step = 1e-5 * np.eye(len(vector))[index]
        difference = (problem.errors(vector + step) - problem.errors(vector - step)) / 2e-5
        np.testing.assert_allclose(column, difference, atol=1e-5 * np.abs(difference).max())


@pytest.mark.parametrize(
    ("key", "names"),
    [
        ("surfaces.0.tilt_deg.2", r"surfaces\.0\.tilt_deg\.2"),
        ("surfaces.0.tilt_deg.0", r"surfaces\.0\.decenter_m\.1, .*surfaces\.0\.tilt_deg\.0"),
    ],
)
def test_what_corners_do_not_tell(key, names):
    """A ball that is turned is the same ball, and one that is tilted about its vertex is aside."""
    boards = boards_of(parse_optics(BALL), 4)
    with pytest.raises(OpticsError, match=f"{names}: not determined by the corners"):
        calibrate_system(BALL, ["surfaces.0.decenter_m", key], boards)


@pytest.mark.parametrize(
    ("key", "message"),
    [
        ("surfaces.1.radius_m", "surfaces.1.radius_m: expected a number, got no such key"),
        ("surfaces.0.shape", "surfaces.0.shape: expected a number, got 'sphere'"),
        ("surfaces", "surfaces: expected a number, got "),
        ("", ": expected a number, got no such key"),
        ("surfaces.0.radius_m,surfaces.0.radius_m", "expected each number once, got it twice"),
    ],
)
def test_keys_that_are_no_parameters(key, message):
    with pytest.raises(OpticsError, match=message):
        FreeParameters(BALL, key.split(","), "ball.toml")


def test_keys_that_are_left_out():
    parameters = FreeParameters(BALL, ["surfaces.0.tilt_deg.1", "surfaces.0.decenter_m"], "a")
    assert parameters.names[0] == "surfaces.0.tilt_deg.1"
    assert parameters.values.tolist() == [0.0] * 4
    table = parameters.table(np.array([2.0, 0.1, 0.2, 0.3]))
    assert table["surfaces"][0]["tilt_deg"] == [0.0, 2.0, 0.0]
    assert "tilt_deg" not in BALL["surfaces"][0]


def test_corners_come_back(tmp_path):
    boards = boards_of(parse_optics(BALL), 3)
    write_corners(tmp_path / "corners.csv", boards)
    again = read_corners(tmp_path / "corners.csv")
    assert len(again) == 3
    for board, other in zip(boards, again, strict=True):
        np.testing.assert_array_equal(board.points_m, other.points_m)
        np.testing.assert_array_equal(board.pixels_px, other.pixels_px)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a,b\n1,2\n", "expected the columns image,x_m,y_m,u_px,v_px, got a,b"),
        ("image,x_m,y_m,u_px,v_px\n0,0,0,1,1\n", "image 0: corners: expected at least 6"),
        ("image,x_m,y_m,u_px,v_px\n0,0,zero,1,1\n", ":2: "),
        ("", "corners.csv"),
    ],
)
def test_files_that_are_no_corners(tmp_path, text, message):
    (tmp_path / "corners.csv").write_text(text)
    with pytest.raises(OpticsError, match=message):
        read_corners(tmp_path / "corners.csv")


def test_no_board_and_boards_that_are_not_seen():
    with pytest.raises(OpticsError, match="corners: expected a board, got none"):
        calibrate_system(BALL, ["surfaces.0.decenter_m"], [])
    board = BoardCorners(GRID_M, np.zeros((len(GRID_M), 2)))
    with pytest.raises(OpticsError, match="where the optics see anything, got 0"):
        calibrate_system(BALL, ["surfaces.0.decenter_m"], [board])
