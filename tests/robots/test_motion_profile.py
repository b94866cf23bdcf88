"""Plans along waypoints, their motion in closed form, and times for given poses."""

import math

import numpy as np
import pytest

from omnisim.core.errors import TrajectoryError
from omnisim.core.poses import pose, rotation_from_quaternion
from omnisim.core.trajectories.trajectory import poses_on_ground
from omnisim.robots.kinematics import Kinematics, find_violation, steps_between
from omnisim.robots.motion_profile import (
    check_waypoints,
    plan_in_steps,
    plan_with_period,
    time_poses,
)
from omnisim.robots.robot_file import load_robot

ROBOT = Kinematics("differential", 1.0, 2.0, 0.5, 4.0)
QUARTER = math.pi / 2


@pytest.mark.parametrize(
    ("robot", "clockwise"), [("superscout", True), ("superscout", False), ("p2at", True)]
)
def test_paper_lap(robot, clockwise):
    """The paper's path on a field of 5.4 m by 3.6 m, in about 100 steps."""
    limits = load_robot(robot).kinematics
    beside, above = ((-2.7, 1.8), (2.7, -1.8)) if clockwise else ((2.7, -1.8), (-2.7, 1.8))
    start, opposite = (-2.7, -1.8), (2.7, 1.8)
    corners = (start, beside, opposite, above, start, opposite)
    lap = plan_in_steps(corners, limits, 0.41, math.radians(12.0)).trajectory
    assert 97 <= len(lap) <= 101
    assert lap.path_length_m == pytest.approx(18.0 + math.hypot(5.4, 3.6))
    at_start = np.all(np.abs(lap.positions_m[:, :2] - start) < 1e-12, axis=1)
    departure = int(np.flatnonzero(at_start)[-1])
    assert 80 <= departure + 1 <= 85  # the paper's diagonal: steps 84 to 100
    turns = steps_between(lap.world_from_base).turns_rad[:departure]
    assert np.all(turns * (-1.0 if clockwise else 1.0) > -1e-12)
    assert find_violation(lap, limits) is None


def test_legs_by_hand():
    """3 m at 1 m/s and 0.5 m/s²: 2 s and 1 m to speed up, 1 s and 1 m, 2 s and 1 m to brake."""
    leg = plan_in_steps([(0, 0), (0, 3)], ROBOT, 0.5, 1.0).trajectory
    np.testing.assert_allclose(leg.positions_m[:, 1], np.arange(7) * 0.5)
    np.testing.assert_allclose(leg.yaw_rad, QUARTER)
    root = math.sqrt(2.0)
    np.testing.assert_allclose(leg.times_s, (0, root, 2, 2.5, 3, 5 - root, 5))
    short = plan_in_steps([(0, 0), (0.5, 0)], ROBOT, 0.25, 1.0).trajectory
    np.testing.assert_allclose(short.times_s, (0, 1, 2))  # too short for the top speed
    # whole steps, whatever the rounding
    assert len(plan_in_steps([(0, 0), (5.4, 0)], ROBOT, 0.1, 1.0).trajectory) == 55


def test_a_turn_by_hand():
    """2 rad at 2 rad/s and 4 rad/s²: half a second and 0.5 rad, twice, and 1 rad between."""
    turn = plan_in_steps([(1, 1), (2, 1)], ROBOT, 10.0, 0.5, start_yaw_rad=-2.0).trajectory
    np.testing.assert_allclose(turn.yaw_rad[:5], (-2, -1.5, -1, -0.5, 0), atol=1e-15)
    np.testing.assert_allclose(turn.times_s[:5], (0, 0.5, 0.75, 1, 1.5))
    np.testing.assert_array_equal(turn.positions_m[:5, :2], np.ones((5, 2)))


@pytest.mark.parametrize(
    ("points", "start_yaw", "turns"),
    [
        ([(0, 0), (1, 0), (1, 1)], None, (QUARTER,)),
        ([(0, 0), (1, 0), (1, -1)], None, (-QUARTER,)),
        ([(0, 0), (1, 0), (2, 0)], None, ()),
        ([(0, 0), (1, 0), (0, 0)], None, (math.pi,)),  # a half turn goes left
        ([(0, 0), (0, 1), (0, 0)], None, (math.pi,)),
        ([(0, 0), (1, 0)], math.pi, (math.pi,)),
        ([(0, 0), (1, 0)], 2 * math.pi, ()),
        ([(0, 0), (1, 0)], -100.0, (math.remainder(100.0, 2 * math.pi),)),
    ],
)
def test_turns_the_short_way(points, start_yaw, turns):
    plan = plan_in_steps(points, ROBOT, 1.0, 0.1, start_yaw).trajectory
    found = steps_between(plan.world_from_base).turns_rad
    runs = np.split(found, np.flatnonzero(np.diff(np.abs(found) > 1e-12)) + 1)
    totals = [float(np.sum(run)) for run in runs if abs(run[0]) > 1e-12]
    assert totals == pytest.approx(turns)


@pytest.mark.parametrize("seed", range(4))
def test_any_path_is_within_the_limits_and_through_its_waypoints(seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(6, 2)) * 10.0 ** rng.uniform(-2, 2)
    robot = Kinematics("skid_steer", *(10.0 ** rng.uniform(-1, 1, 4)))
    step_m, step_rad = 10.0 ** rng.uniform(-1, 1), rng.uniform(0.1, 1.5)
    in_steps = plan_in_steps(points, robot, step_m, step_rad).trajectory
    period_s = in_steps.duration_s / rng.uniform(20, 200)
    with_period = plan_with_period(points, robot, period_s).trajectory
    slack_m = 1e-9 * (1 + np.max(np.abs(points)))
    for plan in (in_steps, with_period):
        assert find_violation(plan, robot) is None
        for point in points:
            assert np.linalg.norm(plan.positions_m[:, :2] - point, axis=1).min() < slack_m
        steps = steps_between(plan.world_from_base)
        assert np.all(np.abs(steps.distances_m[np.abs(steps.turns_rad) > 1e-9]) < slack_m)
        length = np.sum(np.linalg.norm(np.diff(points, axis=0), axis=1))
        assert plan.path_length_m == pytest.approx(length)
    steps = steps_between(in_steps.world_from_base)
    assert np.max(np.abs(steps.distances_m)) <= step_m * (1 + 1e-9)
    assert np.max(np.abs(steps.turns_rad)) <= step_rad * (1 + 1e-9)
    np.testing.assert_allclose(np.diff(with_period.times_s), period_s)
    assert with_period.duration_s < in_steps.duration_s + 11 * period_s  # 6 legs and 5 turns


@pytest.mark.parametrize(
    ("points", "words"),
    [
        ([(0, 0)], r"expected at least 2, got 1"),
        ([(0, 0, 0), (1, 1, 1)], r"shape \(2, 3\)"),
        ([], "expected at least 2, got 0"),
        ([(0, 0), (1,)], r"expected a list of \[x, y\] in meters"),
        ([(0, 0), (math.nan, 0)], r"waypoint 1 \[nan, 0\.0\]: expected finite numbers"),
        ([(0, 0), (1e300, 0)], "waypoint 1 .*: expected finite numbers"),
        ([(0, 0), (1, 0), (1, 0)], "waypoints 1 and 2 are the same"),
    ],
)
def test_bad_waypoints(points, words):
    with pytest.raises(TrajectoryError, match=words):
        check_waypoints(points)


@pytest.mark.parametrize(
    ("plan", "numbers", "words"),
    [
        (plan_in_steps, (0.0, 0.1), "step_m = 0: expected more than 0"),
        (plan_in_steps, (math.nan, 0.1), "step_m = nan: expected more than 0"),
        (plan_in_steps, (0.1, -1.0), "step_rad = -1: expected more than 0"),
        (plan_in_steps, (0.1, 3.0), r"step_rad = 3: expected more than 0, at most 1\.5708"),
        (plan_in_steps, (1e-9, 0.1), r"1e\+09 steps: expected at most 1000000"),
        (plan_in_steps, (0.1, 0.1, math.nan), "start_yaw_rad = nan: expected a finite number"),
        (plan_with_period, (0.0,), "period_s = 0: expected a finite number above 0"),
        (plan_with_period, (math.nan,), "period_s = nan: expected a finite number above 0"),
    ],
)
def test_bad_requests(plan, numbers, words):
    with pytest.raises(TrajectoryError, match=words):
        plan([(0, 0), (1, 0)], ROBOT, *numbers)


# Motion of a plan in closed form.
POINTS = [(0.0, 0.0), (5.0, 0.0), (5.0, 3.3), (0.1, 0.0), (0.1, 0.4)]
LIMITS = load_robot("p2at").kinematics
PLANS = {
    "steps": plan_in_steps(POINTS, LIMITS, 0.35, 0.2),
    "period": plan_with_period(POINTS, LIMITS, 0.1, start_yaw_rad=1.0),
}


@pytest.mark.parametrize("plan", PLANS.values(), ids=PLANS)
def test_it_goes_through_the_plans_poses_from_rest_to_rest(plan):
    poses = plan.motion.at(plan.trajectory.times_s).world_from_base
    np.testing.assert_allclose(poses, plan.trajectory.world_from_base, atol=1e-13)
    end_s = plan.motion.end_s
    assert end_s == pytest.approx(plan.trajectory.times_s[-1], abs=1e-9)
    states = plan.motion.at(np.array([-1.0, 0.0, end_s, end_s + 1.0]))
    assert np.abs(states.velocity_mps).max() < 1e-12
    assert np.abs(states.angular_rate_radps).max() < 1e-12
    assert math.isclose(states.world_from_base[-1, 1, 3], 0.4)


@pytest.mark.parametrize("plan", PLANS.values(), ids=PLANS)
def test_rates_are_central_differences_and_keep_to_the_limits(plan):
    motion, h = plan.motion, 1e-6
    times = np.linspace(0.0, motion.end_s, 10_001)
    before, now, after = (motion.at(times + shift) for shift in (-h, 0.0, h))
    moved = (after.world_from_base - before.world_from_base)[:, :3, 3] / (2.0 * h)
    # across a jump of the acceleration they differ by a quarter of it times the difference's step
    np.testing.assert_allclose(now.velocity_mps, moved, atol=0.5 * h * LIMITS.max_acceleration_mps2)
    turned = np.gradient(
        np.unwrap(np.arctan2(now.world_from_base[:, 1, 0], now.world_from_base[:, 0, 0])), times
    )
    off = np.abs(turned - now.angular_rate_radps[:, 2])
    assert off.max() <= LIMITS.max_turn_acceleration_radps2 * (times[1] - times[0])
    speeds = np.linalg.norm(now.velocity_mps, axis=1)
    assert speeds.max() <= LIMITS.max_speed_mps * (1.0 + 1e-12)
    # speed changes by the acceleration at most, from any time to any other
    assert np.abs(np.diff(speeds)).max() <= LIMITS.max_acceleration_mps2 * times[1] * (1.0 + 1e-9)
    accelerations = np.linalg.norm(now.acceleration_mps2, axis=1)
    assert accelerations.max() <= LIMITS.max_acceleration_mps2 * (1.0 + 1e-12)
    rates = np.abs(now.angular_rate_radps[:, 2])
    assert rates.max() <= LIMITS.max_turn_rate_radps * (1.0 + 1e-12)


# Times for given poses.


@pytest.mark.parametrize("step_m", [0.05, 1.0])
def test_as_fast_as_a_plan_and_a_step_at_most_faster(step_m):
    plan = plan_in_steps([(0, 0), (5, 0), (5, 3), (0, 0)], ROBOT, step_m, 0.2).trajectory
    timed = time_poses(plan.world_from_base, ROBOT)
    assert find_violation(timed, ROBOT) is None
    slack = 3 * step_m / ROBOT.max_speed_mps + 2 * 0.2 / ROBOT.max_turn_rate_radps
    assert plan.duration_s - slack <= timed.duration_s <= plan.duration_s * (1 + 1e-9)


@pytest.mark.parametrize(
    ("x_m", "times_s"),
    [
        # from rest at 0.5 m/s²: 0.25 m after 1 s, 1 m after 2 s, then 1 m/s; the other end alike
        ((0, 0.25, 1, 2, 3, 3.75, 4), (0, 1, 2, 3, 4, 5, 6)),
        ((0, 0.5), (0, 2)),  # rest to rest in one step
        ((0,), (0,)),
    ],
)
def test_speeding_up_by_hand(x_m, times_s):
    timed = time_poses(poses_on_ground([(x, 0) for x in x_m], np.zeros(len(x_m))), ROBOT)
    np.testing.assert_allclose(timed.times_s, times_s)


def test_circle_is_driven_at_the_limit_that_binds():
    """Radius 0.25 m: 2 rad/s are reached at 0.5 m/s, half the top speed."""
    angles = np.linspace(0.0, 20 * math.pi, 1001)
    points = 0.25 * np.stack((np.cos(angles), np.sin(angles)), axis=-1)
    timed = time_poses(poses_on_ground(points, angles + math.pi / 2), ROBOT)
    assert find_violation(timed, ROBOT) is None
    rates = np.diff(angles) / np.diff(timed.times_s)
    np.testing.assert_allclose(rates[300:700], 2.0)


@pytest.mark.parametrize("seed", range(6))
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


@pytest.mark.parametrize(
    ("poses", "words"),
    [
        (np.zeros((0, 4, 4)), r"poses \(0, 4, 4\): expected \(n, 4, 4\), n ≥ 1"),
        (pose(), r"poses \(4, 4\)"),
        (np.stack([pose(), pose((1, 0, 0)), pose((1, 0, 0))]), "poses 1 and 2 are the same"),
        (np.stack([pose(), 2.0 * pose()]), "pose 1: expected a rotation"),
    ],
)
def test_bad_poses(poses, words):
    with pytest.raises(TrajectoryError, match=words):
        time_poses(poses, ROBOT)
