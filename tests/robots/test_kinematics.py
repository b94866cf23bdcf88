"""Limits of a robot, and motion beyond them."""

import math

import numpy as np
import pytest

from omnisim.core.errors import TrajectoryError
from omnisim.core.trajectories.trajectory import Trajectory
from omnisim.robots.kinematics import (
    Kinematics,
    check_drivable,
    find_drift,
    find_violation,
    steps_between,
)

ROBOT = Kinematics("differential", 1.0, 2.0, 0.5, 4.0)


def _line(positions, times, yaw=None):
    points = [(x, 0.0) for x in positions]
    return Trajectory.on_ground(times, points, np.zeros(len(points)) if yaw is None else yaw)


def _slide(left_m, count, up_m=0.0, noise_m=0.0, ahead_m=0.0):
    """A slide with the heading kept, slowly."""
    shares = np.linspace(0.0, 1.0, count)
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, :3, 3] = shares[:, None] * (ahead_m, left_m, up_m)
    poses[:, :3, 3] += np.random.default_rng(0).normal(0.0, noise_m, (count, 3))
    return Trajectory(100.0 * shares, poses)


def _arc(count, step_s):
    """A turn along circles of 4 m radius, at 0.4 m/s."""
    times = step_s * np.arange(count)
    yaw = 0.1 * times
    return Trajectory.on_ground(times, np.stack((4 * np.sin(yaw), 4 - 4 * np.cos(yaw)), 1), yaw)


def test_steps():
    steps = steps_between(_line([0, 1, 0.5, 0.5], np.arange(4.0), [0, 0, 0, -3.0]).world_from_base)
    np.testing.assert_allclose(steps.distances_m, (1, -0.5, 0), atol=1e-15)  # the second: backwards
    np.testing.assert_allclose(steps.turns_rad, (0, 0, -3.0), atol=1e-15)


@pytest.mark.parametrize(
    ("trajectory", "quantity", "step", "asked", "allowed"),
    [
        (_line([0, 1, 3], [0, 1, 2]), "speed", 1, 2.0, 1.0),
        (_line([0, 0, -3], [0, 1, 2]), "speed", 1, 3.0, 1.0),
        (_line([0, 0, 0], [0, 1, 2], [0, 0, -2.5]), "turn rate", 1, 2.5, 2.0),
        (_line([0, 0.1, 0.9], [0, 1, 2]), "acceleration", 1, 0.7, 0.5),
        (_line([0, 0.9, 0.8], [0, 1, 2]), "acceleration", 1, 1.0, 0.5),
        (_line([0, 0, 0], [0, 0.1, 0.2], [0, 0.15, 0]), "turn acceleration", 1, 30.0, 4.0),
        (_line([0, 5, 5], [0, 1, 2], [0, 3.0, 0]), "speed", 0, 5.0, 1.0),  # the first of several
        (_line([0, 1], [0, 5e-324]), "speed", 0, math.inf, 1.0),
    ],
)
def test_excess(trajectory, quantity, step, asked, allowed):
    violation = find_violation(trajectory, ROBOT)
    assert (violation.quantity, violation.step, violation.limit) == (quantity, step, allowed)
    assert violation.value == pytest.approx(asked)
    words = rf"{quantity} {asked:g} \S+: expected at most {allowed:g} "
    with pytest.raises(TrajectoryError, match=f"^a: step {step} → {step + 1} at .* s: {words}"):
        check_drivable(trajectory, ROBOT, "a")


@pytest.mark.parametrize(
    "trajectory",
    [
        _line([0], [0]),
        _line([0, 1], [0, 1]),
        _line([0, 0.75, 1.75, 2.5], [0, 1, 2, 3]),
        _line([0, 0], [0, 1], [3.0, -3.0]),  # across ±π: 0.28 rad
    ],
)
def test_within_the_limits(trajectory):
    assert find_violation(trajectory, ROBOT) is None
    check_drivable(trajectory, ROBOT, "a")


@pytest.mark.parametrize(
    ("trajectory", "quantity", "step", "asked", "allowed"),
    [
        (_slide(1.0, 2), "sideways motion", 0, 1.0, 0.1),
        (_slide(-1.0, 101), "sideways motion", 10, 0.11, 0.1),  # a centimeter a step adds up
        (_slide(0.0, 11, up_m=1.0), "vertical motion", 1, 0.2, 0.1),
    ],
)
def test_drift(trajectory, quantity, step, asked, allowed):
    violation = find_drift(trajectory)
    assert (violation.quantity, violation.step, violation.limit) == (quantity, step, allowed)
    assert violation.value == pytest.approx(asked)
    with pytest.raises(TrajectoryError, match=f"^a: step {step} → .* {quantity} "):
        check_drivable(trajectory, ROBOT, "a")


@pytest.mark.parametrize(
    "trajectory",
    [
        _line([0], [0]),
        _line([0, 0], [0, 1], [0.0, math.pi]),
        _slide(0.0, 101, noise_m=0.015, ahead_m=20.0),
        _slide(1.0, 101, ahead_m=20.0),  # 3° off: its heading has an error
        _slide(0.0, 101, up_m=5.0, ahead_m=20.0),  # a slope, under level poses
        _arc(600, 0.1),
        _arc(30, 2.0),
    ],
)
def test_drift_within_what_wheels_do(trajectory):
    assert find_drift(trajectory) is None


def test_limits_must_be_positive_and_the_drive_known():
    for position, value in enumerate((0.0, -1.0, math.nan, math.inf)):
        limits = [1.0] * 4
        limits[position] = value
        with pytest.raises(TrajectoryError, match=r"max_.*: expected a (finite )?number"):
            Kinematics("differential", *limits)
    with pytest.raises(TrajectoryError, match="drive: expected 'differential' or 'skid_steer'"):
        Kinematics("mecanum", 1.0, 1.0, 1.0, 1.0)
