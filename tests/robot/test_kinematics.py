import math

import numpy as np
import pytest

from omnisim.errors import TrajectoryError
from omnisim.robot.kinematics import Kinematics, check_drivable, find_violation, steps_between
from omnisim.robot.trajectory import Trajectory

ROBOT = Kinematics("differential", 1.0, 2.0, 0.5, 4.0)


def _line(positions, times, yaw=None):
    points = [(x, 0.0) for x in positions]
    return Trajectory.on_ground(times, points, np.zeros(len(points)) if yaw is None else yaw)


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


def test_message():
    words = r"^a\.tum: step 1 → 2 at 1 s: speed 2 m/s: expected at most 1 m/s$"
    with pytest.raises(TrajectoryError, match=words):
        check_drivable(_line([0, 1, 3], [0, 1, 2]), ROBOT, "a.tum")


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf, 1e-300])
@pytest.mark.parametrize("position", range(4))
def test_limits_must_be_positive(position, value):
    limits = [1.0, 1.0, 1.0, 1.0]
    limits[position] = value
    with pytest.raises(TrajectoryError, match=r"max_.* expected a number from 1e-06"):
        Kinematics("differential", *limits)


def test_drive_must_be_known():
    with pytest.raises(
        TrajectoryError, match="'mecanum': expected one of differential, skid_steer"
    ):
        Kinematics("mecanum", 1.0, 1.0, 1.0, 1.0)
