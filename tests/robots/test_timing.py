import math

import numpy as np
import pytest

from omnisim.core.errors import TrajectoryError
from omnisim.core.poses import pose, rotation_from_quaternion
from omnisim.core.trajectories.trajectory import poses_on_ground
from omnisim.robots.kinematics import Kinematics, find_violation
from omnisim.robots.motion_profile import plan_in_steps, time_poses

ROBOT = Kinematics("differential", 1.0, 2.0, 0.5, 4.0)


@pytest.mark.parametrize("step_m", [0.05, 0.2, 1.0])
def test_as_fast_as_a_plan_and_a_step_at_most_faster(step_m):
    plan = plan_in_steps([(0, 0), (5, 0), (5, 3), (0, 0)], ROBOT, step_m, 0.2).trajectory
    timed = time_poses(plan.world_from_base, ROBOT)
    assert find_violation(timed, ROBOT) is None
    slack = 3 * step_m / ROBOT.max_speed_mps + 2 * 0.2 / ROBOT.max_turn_rate_radps
    assert plan.duration_s - slack <= timed.duration_s <= plan.duration_s * (1 + 1e-9)


def test_speeding_up_by_hand():
    """From rest at 0.5 m/s²: 0.25 m after 1 s, 1 m after 2 s, then 1 m/s; the other end alike."""
    points = [(x, 0) for x in (0, 0.25, 1, 2, 3, 3.75, 4)]
    timed = time_poses(poses_on_ground(points, np.zeros(7)), ROBOT)
    np.testing.assert_allclose(timed.times_s, (0, 1, 2, 3, 4, 5, 6))


def test_rest_to_rest_in_one_step():
    timed = time_poses(poses_on_ground([(0, 0), (0.5, 0)], [0, 0]), ROBOT)
    np.testing.assert_allclose(timed.times_s, (0, 2))


def test_circle_is_driven_at_the_limit_that_binds():
    """Radius 0.25 m: 2 rad/s are reached at 0.5 m/s, half the top speed."""
    angles = np.linspace(0.0, 20 * math.pi, 1001)
    points = 0.25 * np.stack((np.cos(angles), np.sin(angles)), axis=-1)
    timed = time_poses(poses_on_ground(points, angles + math.pi / 2), ROBOT)
    assert find_violation(timed, ROBOT) is None
    rates = np.diff(angles) / np.diff(timed.times_s)
    np.testing.assert_allclose(rates[300:700], 2.0)


@pytest.mark.parametrize("seed", range(12))
def test_any_poses_are_within_the_limits(seed):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 200))
    robot = Kinematics("skid_steer", *(10.0 ** rng.uniform(-2, 2, 4)))
    if seed % 2:
        poses = np.zeros((count, 4, 4))
        poses[:, :3, :3] = rotation_from_quaternion(rng.normal(size=(count, 4)))
        poses[:, :3, 3], poses[:, 3, 3] = rng.normal(size=(count, 3)), 1.0
    else:
        walk = np.cumsum(rng.normal(size=(count, 3)) * (0.1, 0.1, 0.3), axis=0)
        poses = poses_on_ground(walk[:, :2], walk[:, 2])
    timed = time_poses(poses, robot)
    np.testing.assert_array_equal(timed.world_from_base, poses)
    assert find_violation(timed, robot) is None


def test_one_pose():
    assert time_poses(pose()[None], ROBOT).times_s.tolist() == [0.0]


@pytest.mark.parametrize(
    ("poses", "words"),
    [
        (np.zeros((0, 4, 4)), r"poses \(0, 4, 4\): expected \(n, 4, 4\), n ≥ 1"),
        (pose(), r"poses \(4, 4\)"),
        (np.stack([pose(), pose((1, 0, 0)), pose((1, 0, 0))]), "poses 1 and 2 are the same"),
        (np.stack([pose(), 2.0 * pose()]), "pose 1: expected a rotation"),
        (np.full((2, 4, 4), math.nan), "pose 0: expected finite numbers"),
    ],
)
def test_bad_poses(poses, words):
    with pytest.raises(TrajectoryError, match=words):
        time_poses(poses, ROBOT)
