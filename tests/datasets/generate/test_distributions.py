"""Distributions of plans, against those of SciPy."""

import numpy as np
import pytest
from scipy import stats

from omnisim.core.errors import PlanError
from omnisim.core.files.parameters import Table, parse_table
from omnisim.datasets.generate.distributions import Distributed, Distribution, RandomStream


class _One(Table):
    value: Distributed


def _parse(value):
    return parse_table({"value": value}, _One, PlanError, "plan.toml").value


def _numbers(value, count=4000):
    parsed, stream = _parse(value), RandomStream(3, 1, 4)
    return np.array([parsed.draw(stream) for _ in range(count)])


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        ([0.2, 1.0], stats.uniform(0.2, 0.8)),
        ({"uniform": [-2, 5]}, stats.uniform(-2, 7)),
        ({"normal": [1.0, 2.0]}, stats.norm(1.0, 2.0)),
        ({"log_uniform": [0.1, 10.0]}, stats.loguniform(0.1, 10.0)),
    ],
)
def test_numbers_have_their_distribution(value, expected):
    assert stats.kstest(_numbers(value), expected.cdf).pvalue > 0.001


def test_choices_are_equally_frequent():
    values, counts = np.unique(_numbers({"choice": [1.0, 2.0, 7.0]}), return_counts=True)
    assert values.tolist() == [1.0, 2.0, 7.0]
    assert stats.chisquare(counts).pvalue > 0.001


def test_a_stream_is_a_function_of_its_keys():
    first = [RandomStream(1, 2, 3, 4).share() for _ in range(2)]
    assert first[0] == first[1]
    others = {
        RandomStream(*keys).share()
        for keys in ((1, 2, 3, 5), (1, 2, 4, 4), (1, 3, 3, 4), (2, 2, 3, 4))
    }
    assert len({first[0], *others}) == 5


def test_numbers_stay_the_same_from_version_to_version():
    # a data set that was begun must go on: published plans depend on these
    stream = RandomStream(7, 12, 0, 1)
    drawn = [round(stream.share(), 12) for _ in range(3)]
    assert drawn == [0.509201499489, 0.199887034823, 0.871464165332]


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("wide", "value: expected a number, [low, high], "),
        ([1.0], "uniform: expected 2 numbers, got 1"),
        ([2.0, 1.0], "expected [low, high] in this order, got [2.0, 1.0]"),
        ({"normal": [0.0, -1.0]}, "normal: expected a deviation ≥ 0, got -1"),
        ({"log_uniform": [0.0, 1.0]}, "log_uniform: expected 0 < low ≤ high, got [0.0, 1.0]"),
        ({"gamma": [1.0, 1.0]}, "value: expected a number, [low, high], "),
        ({"choice": []}, "value: expected a number, [low, high], "),
        (True, "value: expected a number, [low, high], "),
        (float("inf"), "value: expected a number, [low, high], "),
        ([0.0, float("nan")], "value: expected a number, [low, high], "),
    ],
)
def test_other_values_are_refused_in_one_line(value, message):
    with pytest.raises(PlanError) as caught:
        _parse(value)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_ends_are_known():
    assert (_parse([0.2, 1.0]).low, _parse([0.2, 1.0]).high) == (0.2, 1.0)
    assert _parse({"normal": [1.0, 0.0]}).low == 1.0
    assert _parse({"normal": [1.0, 0.1]}).low == -np.inf
    assert Distribution("constant", (2.0,)).high == 2.0
    assert set(_numbers(1.5, 10)) == {1.5}
