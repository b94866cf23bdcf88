import math

import numpy as np
import pytest

from omnisim.core.errors import TrajectoryError
from omnisim.core.poses import pose
from omnisim.core.trajectories.trajectory import Trajectory, check_continuous


def _square():
    corners = [(0, 0), (3, 0), (3, 4), (0, 4), (0, 0)]
    return Trajectory.on_ground(np.arange(5.0), corners, np.radians([0, 90, 180, -90, 0]))


def test_what_a_trajectory_says():
    square = _square()
    assert len(square) == 5
    assert square.path_length_m == 14.0
    assert square.duration_s == 4.0
    np.testing.assert_array_equal(square.step_lengths_m, (3, 4, 3, 4))
    np.testing.assert_allclose(np.degrees(square.yaw_rad), (0, 90, 180, -90, 0), atol=1e-13)
    np.testing.assert_array_equal(square.positions_m[2], (3, 4, 0))


def test_one_pose_is_enough_and_may_be_tilted():
    one = Trajectory([5.0], pose((1, 2, 3), roll_deg=20, pitch_deg=-30, yaw_deg=70)[None])
    assert (len(one), one.path_length_m, one.duration_s) == (1, 0.0, 0.0)
    assert len(one.jumps(0.0)) == 0
    assert math.degrees(one.yaw_rad[0]) == pytest.approx(70)


def test_nothing_can_change_it():
    times, poses = np.arange(2.0), np.stack((pose(), pose((1, 0, 0))))
    trajectory = Trajectory(times, poses)
    times[1], poses[1, 0, 3] = 7.0, 7.0
    assert trajectory.times_s[1] == trajectory.world_from_base[1, 0, 3] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        trajectory.times_s[0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        trajectory.positions_m[0] = 1.0


def _bad_pose(row, column, value):
    poses = np.stack([pose()] * 3)
    poses[1, row, column] = value
    return poses


@pytest.mark.parametrize(
    ("times", "poses", "words"),
    [
        ([], np.zeros((0, 4, 4)), "no pose: expected at least one"),
        ([0, 1], np.stack([pose()] * 3), r"got \(2,\) and \(3, 4, 4\)"),
        ([0, 1, 1], None, "time 2, 1 s, is not after time 1, 1 s"),
        ([0, math.nan, 1], None, "time 1 is nan s: expected a finite time"),
        ([0, 1, 1e300], None, r"time 2 is 1e\+300 s"),
        ([0, 1, 2], _bad_pose(0, 3, math.nan), "pose 1: expected finite numbers"),
        ([0, 1, 2], _bad_pose(0, 0, 2), "pose 1: expected a rotation and a translation"),
        ([0, 1, 2], _bad_pose(3, 0, 1), "pose 1: expected a rotation and a translation"),
    ],
)
def test_refused(times, poses, words):
    with pytest.raises(TrajectoryError, match=words):
        Trajectory(times, np.stack([pose()] * 3) if poses is None else poses)


@pytest.mark.parametrize(
    ("positions", "yaw", "words"),
    [
        ([(0, 0)], [math.nan], "headings that are finite"),
        ([(0, 0, 0)], [0.0], r"expected positions \(n, 2\) and headings \(n,\)"),
        ([(math.nan, 0)], [0.0], "pose 0: expected finite numbers"),
    ],
)
def test_refused_on_ground(positions, yaw, words):
    with pytest.raises(TrajectoryError, match=words):
        Trajectory.on_ground([0.0], positions, yaw)


def test_jumps():
    square = _square()
    np.testing.assert_array_equal(square.jumps(3.5), (1, 3))
    np.testing.assert_array_equal(square.jumps(4.0), ())
    np.testing.assert_array_equal(square.jumps(math.inf, max_speed_mps=3.5), (1, 3))


def test_check_continuous():
    square = _square()
    check_continuous(square, 4.0, "square")
    check_continuous(square, math.inf, "square", max_speed_mps=4.0)
    message = r"^a\.tum: step 1 → 2: 4 m in 1 s: expected at most 3 m"
    with pytest.raises(TrajectoryError, match=message):
        check_continuous(square, 3.0, "a.tum")
    with pytest.raises(TrajectoryError, match=r"^a\.tum:12: step 1 → 2: .* at most 3\.5 m/s$"):
        check_continuous(square, 9.0, "a.tum", 3.5, lines=[10, 11, 12, 13, 14])
