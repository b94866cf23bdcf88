import math

import numpy as np
import pytest

from omnisim.core.errors import TrajectoryError
from omnisim.robots.kinematics import Kinematics, find_violation, steps_between
from omnisim.robots.motion_profile import check_waypoints, plan_in_steps, plan_with_period
from omnisim.robots.robot_file import load_robot

PIONEER_2_AT, SUPER_SCOUT = load_robot("p2at"), load_robot("superscout")
ROBOT = Kinematics("differential", 1.0, 2.0, 0.5, 4.0)
QUARTER = math.pi / 2


def paper_lap(robot=SUPER_SCOUT, clockwise=True):
    """The paper's path on a field of 5.4 m by 3.6 m, in about 100 steps."""
    beside, above = (2.7, -1.8), (-2.7, 1.8)
    if clockwise:
        beside, above = above, beside
    start, opposite = (-2.7, -1.8), (2.7, 1.8)
    corners = (start, beside, opposite, above, start, opposite)
    return plan_in_steps(corners, robot.kinematics, 0.41, math.radians(12.0)).trajectory


@pytest.mark.parametrize("robot", [SUPER_SCOUT, PIONEER_2_AT])
@pytest.mark.parametrize("clockwise", [True, False])
def test_paper_lap(robot, clockwise):
    lap = paper_lap(robot, clockwise)
    assert 97 <= len(lap) <= 101
    assert lap.path_length_m == pytest.approx(18.0 + math.hypot(5.4, 3.6))
    at_start = np.all(np.abs(lap.positions_m[:, :2] - (-2.7, -1.8)) < 1e-12, axis=1)
    departure = int(np.flatnonzero(at_start)[-1])
    assert 80 <= departure + 1 <= 85  # the paper's diagonal: steps 84 to 100
    turns = steps_between(lap.world_from_base).turns_rad[:departure]
    assert np.all(turns * (-1.0 if clockwise else 1.0) > -1e-12)
    assert find_violation(lap, robot.kinematics) is None


def test_a_leg_by_hand():
    """3 m at 1 m/s and 0.5 m/s²: 2 s and 1 m to speed up, 1 s and 1 m, 2 s and 1 m to brake."""
    leg = plan_in_steps([(0, 0), (0, 3)], ROBOT, 0.5, 1.0).trajectory
    np.testing.assert_allclose(leg.positions_m[:, 1], np.arange(7) * 0.5)
    np.testing.assert_allclose(leg.yaw_rad, QUARTER)
    root = math.sqrt(2.0)
    np.testing.assert_allclose(leg.times_s, (0, root, 2, 2.5, 3, 5 - root, 5))


def test_a_leg_too_short_for_the_top_speed():
    leg = plan_in_steps([(0, 0), (0.5, 0)], ROBOT, 0.25, 1.0).trajectory
    np.testing.assert_allclose(leg.times_s, (0, 1, 2))


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
        ([(0, 0), (0, -1), (0, 0)], None, (math.pi,)),
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


@pytest.mark.parametrize("seed", range(8))
def test_any_path_is_within_the_limits_and_through_its_waypoints(seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(6, 2)) * 10.0 ** rng.uniform(-2, 2)
    robot = Kinematics("skid_steer", *(10.0 ** rng.uniform(-1, 1, 4)))
    step_m, step_rad = 10.0 ** rng.uniform(-1, 1), rng.uniform(0.1, 1.5)
    in_steps = plan_in_steps(points, robot, step_m, step_rad).trajectory
    period_s = in_steps.duration_s / rng.uniform(20, 200)
    with_period = plan_with_period(points, robot, period_s).trajectory
    for plan in (in_steps, with_period):
        assert find_violation(plan, robot) is None
        for point in points:
            gaps = np.linalg.norm(plan.positions_m[:, :2] - point, axis=1)
            assert np.min(gaps) < 1e-9 * (1 + np.max(np.abs(points)))
        steps = steps_between(plan.world_from_base)
        turning = np.abs(steps.turns_rad) > 1e-9
        assert np.all(np.abs(steps.distances_m[turning]) < 1e-9 * (1 + np.max(np.abs(points))))
        length = np.sum(np.linalg.norm(np.diff(points, axis=0), axis=1))
        assert plan.path_length_m == pytest.approx(length)
    steps = steps_between(in_steps.world_from_base)
    assert np.max(np.abs(steps.distances_m)) <= step_m * (1 + 1e-9)
    assert np.max(np.abs(steps.turns_rad)) <= step_rad * (1 + 1e-9)
    np.testing.assert_allclose(np.diff(with_period.times_s), period_s)
    assert with_period.duration_s < in_steps.duration_s + 11 * period_s  # 6 legs and 5 turns


def test_whole_steps_whatever_the_rounding():
    assert len(plan_in_steps([(0, 0), (5.4, 0)], ROBOT, 0.1, 1.0).trajectory) == 55


@pytest.mark.parametrize(
    ("points", "words"),
    [
        ([(0, 0)], r"expected at least 2, got 1"),
        ([(0, 0, 0), (1, 1, 1)], r"shape \(2, 3\)"),
        ([], "expected at least 2, got 0"),
        ("abc", r"expected a list of \[x, y\] in meters"),
        ([(0, 0), (1,)], r"expected a list of \[x, y\] in meters"),
        ([(0, 0), (math.nan, 0)], r"waypoint 1 \[nan, 0\.0\]: expected finite numbers"),
        ([(0, 0), (1e300, 0)], "waypoint 1 .*: expected finite numbers"),
        ([(0, 0), (1, 0), (1, 0)], "waypoints 1 and 2 are the same"),
    ],
)
def test_bad_waypoints(points, words):
    with pytest.raises(TrajectoryError, match=words):
        check_waypoints(points)


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan])
def test_bad_steps(value):
    path = [(0, 0), (1, 0)]
    with pytest.raises(TrajectoryError, match=r"step_m = .*: expected more than 0"):
        plan_in_steps(path, ROBOT, value, 0.1)
    with pytest.raises(TrajectoryError, match=r"step_rad = .*: expected more than 0"):
        plan_in_steps(path, ROBOT, 0.1, value)
    with pytest.raises(TrajectoryError, match=r"period_s = .*: expected a finite number above 0"):
        plan_with_period(path, ROBOT, value)


def test_other_bad_requests():
    path = [(0, 0), (1, 0)]
    with pytest.raises(
        TrajectoryError, match=r"step_rad = 3: expected more than 0, at most 1\.5708"
    ):
        plan_in_steps(path, ROBOT, 0.1, 3.0)
    with pytest.raises(TrajectoryError, match=r"1e\+09 steps: expected at most 1000000"):
        plan_in_steps(path, ROBOT, 1e-9, 0.1)
    with pytest.raises(TrajectoryError, match=r"start_yaw_rad = nan: expected a finite number"):
        plan_in_steps(path, ROBOT, 0.1, 0.1, math.nan)
