import math
from dataclasses import replace

import numpy as np
import pytest

from omnisim.core.errors import TrajectoryError
from omnisim.core.trajectories.odometry import (
    Odometry,
    OdometryErrors,
    read_odometry,
    simulate_odometry,
    wheel_readings,
    write_odometry,
)
from omnisim.core.trajectories.trajectory import Trajectory
from omnisim.robots.motion_profile import plan_in_steps, plan_with_period
from omnisim.robots.robot_file import load_robot

PIONEER_2_AT, SUPER_SCOUT = load_robot("p2at"), load_robot("superscout")
PERFECT = OdometryErrors()
# simulate_odometry with seed 2008 along 2 m, noise 1
PINNED_DISTANCES = [0.6863303426535377, 2.324524461014188]
PINNED_TURNS = [-0.9079500071949156, -0.18707487712598647]
HEADER = "t_s,distance_m,turn_rad,x_m,y_m,yaw_rad\n"
POINTS = [(0, 0), (3, 1), (3, 4), (-2, 4), (0, 0), (3, 4)]


def paper_lap(robot=SUPER_SCOUT, clockwise=True):
    """The paper's path on a field of 5.4 m by 3.6 m, in about 100 steps."""
    beside, above = (2.7, -1.8), (-2.7, 1.8)
    if clockwise:
        beside, above = above, beside
    start, opposite = (-2.7, -1.8), (2.7, 1.8)
    corners = (start, beside, opposite, above, start, opposite)
    return plan_in_steps(corners, robot.kinematics, 0.41, math.radians(12.0)).trajectory


def _apart(first, second):
    return float(np.max(np.abs(first.world_from_base - second.world_from_base)))


def _arcs(seed=0, count=500):
    """A path of random arcs, forwards and backwards."""
    rng = np.random.default_rng(seed)
    distances, turns = rng.normal(0, 0.3, count), rng.uniform(-3.0, 3.0, count)
    return Odometry(np.arange(count + 1.0), distances, turns, (1.0, -2.0, 0.5))


def test_quarter_circle_by_hand():
    """Radius 2 m to the left, from the origin along x."""
    poses = Odometry([0, 1], [math.pi], [math.pi / 2]).planar_poses
    np.testing.assert_allclose(poses, [(0, 0, 0), (2, 2, math.pi / 2)], atol=1e-15)


@pytest.mark.parametrize("pieces", [2, 100])
def test_an_arc_is_the_same_in_any_number_of_pieces(pieces):
    share = np.full(pieces, 1.0 / pieces)
    poses = Odometry(np.arange(pieces + 1.0), 1.7 * share, -2.5 * share, (0, 0, 1)).planar_poses
    whole = Odometry([0, 1], [1.7], [-2.5], (0, 0, 1)).planar_poses
    np.testing.assert_allclose(poses[-1], whole[-1], atol=1e-14)


@pytest.mark.parametrize(
    "truth",
    [
        paper_lap(),
        plan_in_steps(POINTS, SUPER_SCOUT.kinematics, 0.1, 0.1, start_yaw_rad=3.0).trajectory,
        plan_with_period(POINTS, PIONEER_2_AT.kinematics, 0.1).trajectory,
        _arcs().dead_reckoned(),
        Trajectory.on_ground([0.0], [(1, 2)], [3]),
    ],
    ids=["lap", "steps", "period", "arcs", "one pose"],
)
def test_without_errors_it_is_the_truth(truth):
    assert _apart(simulate_odometry(truth, PERFECT, 0).dead_reckoned(), truth) < 1e-12


def test_readings_of_arcs_are_the_arcs():
    arcs = _arcs()
    again = wheel_readings(arcs.dead_reckoned())
    np.testing.assert_allclose(again.distances_m, arcs.distances_m, atol=1e-12)
    np.testing.assert_allclose(again.turns_rad, arcs.turns_rad, atol=1e-12)


def test_sideways_motion_is_not_seen():
    crab = Trajectory.on_ground([0, 1], [(0, 0), (3, 4)], [0, 0])
    np.testing.assert_allclose(wheel_readings(crab).distances_m, (3.0,))


def test_systematic_errors():
    truth = plan_in_steps([(0, 0), (4, 0), (4, 2)], SUPER_SCOUT.kinematics, 0.5, 0.2).trajectory
    errors = OdometryErrors(distance_scale=1.02, turn_scale=1.1, drift_radpm=0.01)
    odometry, true = simulate_odometry(truth, errors, 0), wheel_readings(truth)
    np.testing.assert_allclose(odometry.distances_m, 1.02 * true.distances_m, atol=1e-15)
    expected = 1.1 * true.turns_rad + 0.01 * true.distances_m
    np.testing.assert_allclose(odometry.turns_rad, expected, atol=1e-15)
    assert np.sum(odometry.distances_m) == pytest.approx(1.02 * 6.0)
    assert np.sum(odometry.turns_rad) == pytest.approx(1.1 * math.pi / 2 + 0.06)


@pytest.mark.parametrize("count", [2, 50])
def test_noise_is_what_it_says_however_the_way_is_cut(count):
    """Mean 0 and the stated sigma of the sums, over 1000 seeds: within 4.5 sigma of both."""
    errors = OdometryErrors(
        distance_noise_m_per_sqrt_m=0.03, turn_noise_rad_per_sqrt_m=0.02,
        turn_noise_rad_per_sqrt_rad=0.05,
    )  # fmt: skip
    way, turn, seeds = 9.0, -4.0, 1000
    truth = Odometry(
        np.arange(count + 1.0), np.full(count, way / count), np.full(count, turn / count)
    ).dead_reckoned()
    runs = [simulate_odometry(truth, errors, seed) for seed in range(seeds)]
    sums = np.array([(np.sum(run.distances_m) - way, np.sum(run.turns_rad) - turn) for run in runs])
    sigma = np.array((0.03 * 3.0, math.sqrt(0.02**2 * way + 0.05**2 * abs(turn))))
    assert np.all(np.abs(np.mean(sums, axis=0)) < 4.5 * sigma / math.sqrt(seeds))
    assert np.all(np.abs(np.std(sums, axis=0) / sigma - 1.0) < 4.5 / math.sqrt(2.0 * seeds))
    assert abs(np.corrcoef(sums.T)[0, 1]) < 4.5 / math.sqrt(seeds)


def test_noise_of_successive_steps_is_independent():
    count = 20000
    truth = Odometry(np.arange(count + 1.0), np.full(count, 0.25), np.zeros(count)).dead_reckoned()
    errors = OdometryErrors(distance_noise_m_per_sqrt_m=0.1, turn_noise_rad_per_sqrt_m=0.1)
    odometry = simulate_odometry(truth, errors, 3)
    for values in (odometry.distances_m - 0.25, odometry.turns_rad):
        assert abs(np.corrcoef(values[1:], values[:-1])[0, 1]) < 4.5 / math.sqrt(count)


def test_standing_still_makes_no_noise():
    truth = Trajectory.on_ground(np.arange(3.0), np.zeros((3, 2)), np.zeros(3))
    odometry = simulate_odometry(truth, SUPER_SCOUT.odometry, 1)
    assert not np.any(odometry.distances_m)
    assert not np.any(odometry.turns_rad)


def test_one_seed_one_run_of_which_a_shorter_way_has_the_beginning():
    lap = paper_lap()
    first, again, other = (simulate_odometry(lap, SUPER_SCOUT.odometry, seed) for seed in (5, 5, 6))
    np.testing.assert_array_equal(first.distances_m, again.distances_m)
    np.testing.assert_array_equal(first.turns_rad, again.turns_rad)
    assert np.any(first.turns_rad != other.turns_rad)
    short = Trajectory(lap.times_s[:40], lap.world_from_base[:40])
    part = simulate_odometry(short, SUPER_SCOUT.odometry, 5)
    np.testing.assert_array_equal(first.distances_m[:39], part.distances_m)


def test_a_seed_means_the_same_numbers_everywhere():
    truth = Trajectory.on_ground([0, 1, 2], [(0, 0), (1, 0), (2, 0)], [0, 0, 0])
    errors = OdometryErrors(distance_noise_m_per_sqrt_m=1.0, turn_noise_rad_per_sqrt_m=1.0)
    odometry = simulate_odometry(truth, errors, 2008)
    np.testing.assert_allclose(odometry.distances_m, PINNED_DISTANCES, rtol=1e-14)
    np.testing.assert_allclose(odometry.turns_rad, PINNED_TURNS, rtol=1e-14)


@pytest.mark.parametrize("seed", range(2))
def test_counters_never_lag_by_more_than_half_a_tick(seed):
    lap = paper_lap()
    plain = replace(SUPER_SCOUT.odometry, distance_tick_m=0.0, turn_tick_rad=0.0)
    exact = simulate_odometry(lap, plain, seed)
    counted = simulate_odometry(lap, SUPER_SCOUT.odometry, seed)
    for name, tick in (("distances_m", 2.54e-3), ("turns_rad", math.radians(0.1))):
        values, ticks = getattr(counted, name), getattr(counted, name) / tick
        np.testing.assert_allclose(ticks, np.rint(ticks), atol=1e-9)
        off = np.cumsum(values) - np.cumsum(getattr(exact, name))
        assert np.max(np.abs(off)) <= 0.5 * tick * (1 + 1e-9)


@pytest.mark.parametrize(
    ("robot", "clockwise"), [(SUPER_SCOUT, True), (PIONEER_2_AT, False)], ids=["real", "simulated"]
)
def test_dead_reckoning_ends_five_percent_of_the_way_off(robot, clockwise):
    """The paper's lap and diagonal, 24.5 m: median 5 % over seeds, from 1 to 12 % in nine of ten.

    The interquartile range is about 4.5 %, so a median of 400 seeds is known to about 0.2 %; the
    bound is four times that. Measured over 2000 seeds: 5.0 % for the Scout, 5.1 % for the Pioneer.
    """
    lap = paper_lap(robot, clockwise)
    ends = []
    for seed in range(400):
        poses = simulate_odometry(lap, robot.odometry, seed).planar_poses
        ends.append(np.hypot(*(poses[-1, :2] - lap.positions_m[-1, :2])) / lap.path_length_m)
    low, median, high = np.quantile(ends, (0.05, 0.5, 0.95))
    assert 0.042 < median < 0.058
    assert 0.004 < low < 0.02
    assert 0.08 < high < 0.15


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"distance_scale": 0.0}, r"odometry\.distance_scale: expected a number > 0, got 0\.0"),
        ({"drift_radpm": math.nan}, "drift_radpm: expected a finite number, got nan"),
        ({"distance_tick_m": -0.1}, r"distance_tick_m: expected a number ≥ 0, got -0\.1"),
        ({"turn_tick_rad": 1e-300}, "turn_tick_rad: expected 0, or at least 1e-09, got 1e-300"),
    ],
)
def test_bad_errors(values, words):
    with pytest.raises(TrajectoryError, match=words):
        OdometryErrors(**values)


def test_bad_requests():
    with pytest.raises(TrajectoryError, match="seed -1: expected 0 or above"):
        simulate_odometry(paper_lap(), PERFECT, -1)
    with pytest.raises(TrajectoryError, match=r"expected \(n,\), \(n − 1,\) and \(n − 1,\)"):
        Odometry([0, 1], [1, 2], [0])
    with pytest.raises(TrajectoryError, match="expected finite times, distances, turns"):
        Odometry([0, 1], [math.nan], [0])


def test_file_there_and_back(tmp_path):
    path = tmp_path / "odometry.csv"
    odometry = simulate_odometry(paper_lap(), PIONEER_2_AT.odometry, 0)
    write_odometry(path, odometry)
    again = read_odometry(path)
    for name in ("times_s", "distances_m", "turns_rad", "start"):
        np.testing.assert_allclose(getattr(again, name), getattr(odometry, name), atol=0.51e-9)
    first = "0.000000000,0.000000000,0.000000000,-2.700000000,-1.800000000,1.57"
    assert path.read_text().startswith(HEADER + first)


def test_file_of_wrapped_headings_and_long_arcs(tmp_path):
    path = tmp_path / "a.csv"
    write_odometry(path, _arcs())
    read_odometry(path)
    path.write_text(HEADER + "0,0,0,0,0,3\n1,0,1,0,0,-2.283185307\n")
    assert read_odometry(path).turns_rad.tolist() == [1.0]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", r"a\.csv: empty"),
        (HEADER, r"a\.csv: only a header"),
        ("t_s,x_m\n0,0\n", r"a\.csv:1: header 't_s,x_m': expected t_s,distance_m"),
        (HEADER + "0,0,0,0,0\n", r"a\.csv:2: 5 columns: expected 6"),
        (HEADER + "0,0,0,0,0,nan\n", r"a\.csv:2: yaw_rad = nan: expected a finite number"),
        (HEADER + "0,1,0,0,0,0\n", r"a\.csv:2: first line: expected distance and turn 0, got 1 m"),
        (HEADER + "0,0,0,0,0,0\n0,1,0,1,0,0\n", r"a\.csv:3: time 0 s repeats 0 s of line 2"),
        (HEADER + "0,0,0,0,0,0\n1,1,0,2,0,0\n", r"a\.csv:3: pose 1 m and 0 rad off the pose"),
        (HEADER + "0,0,0,0,0,0\n1,1,0,1,0,1\n", r"a\.csv:3: pose 0 m and 1 rad off the pose"),
        (HEADER + "0,0,0,1e16,0,0\n", r"a\.csv:2: expected numbers below 1e\+15"),
    ],
)
def test_bad_files(tmp_path, text, words):
    path = tmp_path / "a.csv"
    path.write_text(text)
    with pytest.raises(TrajectoryError, match=words):
        read_odometry(path)
