"""The benchmarks' clock, with work whose cost is known."""

import numpy as np
import pytest

from benchmarks import timer
from benchmarks.timer import Timings, time_interleaved


def test_variants_are_interleaved_and_warm_up_is_not_timed():
    calls = []
    timings = time_interleaved(
        {"a": lambda: calls.append("a"), "b": lambda: calls.append("b")}, rounds=5, warm_up=2
    )
    assert calls == ["a", "b"] * 7
    assert {name: len(seconds) for name, seconds in timings.seconds.items()} == {"a": 5, "b": 5}


def test_ratio_of_pairs_does_not_depend_on_the_load():
    random = np.random.default_rng(3)
    load = random.uniform(1.0, 5.0, 31)  # a slow minute meets both variants of a round
    seconds = {"a": 0.1 * load, "b": 0.13 * load * random.uniform(0.98, 1.02, 31)}
    timings = Timings(seconds, seconds)
    ratio = timings.ratio("b", "a")
    assert ratio.low < 1.3 < ratio.high
    assert ratio.median == pytest.approx(1.3, rel=0.01)
    assert ratio.high - ratio.low < 0.03
    assert timings.cheapest() == "a"
    assert timings.ratio("a", "a") == timer.MedianInterval(1.0, 1.0, 1.0)


def test_interval_holds_the_true_median_as_often_as_it_says():
    random = np.random.default_rng(4)
    held, ones = 0, np.ones(30)
    for _ in range(2000):
        drawn = random.lognormal(0.0, 0.3, 30)  # its median is 1
        ratio = Timings({"a": ones, "b": drawn}, {}).ratio("b", "a")
        held += ratio.low <= 1.0 <= ratio.high
    # at least 95 %; three standard deviations of 2000 draws are 1.5 %
    assert held / 2000 > 0.935


def test_no_round_begins_after_the_time_but_for_the_fewest(monkeypatch):
    now = iter(range(10**6))
    monkeypatch.setattr(timer.time, "perf_counter", lambda: next(now))
    work = {"a": lambda: None}
    assert len(time_interleaved(work, 30, 2, max_seconds=0.0).seconds["a"]) == timer.MIN_ROUNDS
    rounds = len(time_interleaved(work, 30, 0, max_seconds=50.0).seconds["a"])
    assert timer.MIN_ROUNDS < rounds < 30
    timings = time_interleaved(work, 8, 0, max_seconds=10**5)
    assert len(timings.seconds["a"]) == len(timings.processor_seconds["a"]) == 8
