"""Bounds that tell regressions, and distances from goals."""

import math

import pytest

from benchmarks.bounds import Limits, goal_text, reaches_goal
from benchmarks.timer import MedianInterval

FAST = Limits(bound=1.0, goal=2.5, at_least=True, software_only=True)
CHEAP = Limits(bound=1.4, goal=1.15)


@pytest.mark.parametrize(
    ("limits", "value", "passed"),
    [
        (FAST, 1.0, True),
        (FAST, 0.99, False),
        (FAST, MedianInterval(0.95, 0.9, 1.02), True),
        (FAST, MedianInterval(0.95, 0.9, 0.99), False),
        (CHEAP, 1.4, True),
        (CHEAP, 1.41, False),
        (CHEAP, MedianInterval(1.5, 1.39, 1.6), True),
        (CHEAP, MedianInterval(1.5, 1.41, 1.6), False),
        (Limits(goal=1.0), 7.0, None),
        (FAST, math.nan, False),
        (CHEAP, math.nan, False),
    ],
)
def test_a_bound_fails_if_its_whole_interval_misses_it(limits, value, passed):
    assert limits.judge("ratio", value)["passed"] is passed


def test_bounds_that_no_gpu_has_been_measured_for_are_goals_there():
    of_gpu = FAST.judge("ratio", 0.5, is_software=False)
    assert (of_gpu["passed"], of_gpu["bound"], of_gpu["goal"]) == (None, None, 2.5)
    assert CHEAP.judge("ratio", 1.5, is_software=False)["passed"] is False


@pytest.mark.parametrize(
    ("limits", "value", "text"),
    [
        (FAST, 2.5, "reached"),
        (FAST, 2.0, "1.25 × off"),
        (CHEAP, 1.15, "reached"),
        (CHEAP, 2.3, "2 × off"),
        (Limits(goal=0.0, at_least=True), -0.5, "0.5 off"),
        (Limits(bound=1.0), 3.0, ""),
    ],
)
def test_the_distance_from_a_goal_is_a_factor(limits, value, text):
    entry = limits.judge("number", value)
    assert goal_text(entry) == text
    assert reaches_goal(entry) == {"reached": True, "": None}.get(text, False)
