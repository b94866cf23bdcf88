"""The benchmarks' clock, with work whose cost is known, and measurements of processes."""

import mmap

import numpy as np
import pytest

from benchmarks import timer
from benchmarks.errors import BenchmarkError
from benchmarks.idle_driver import idle_driver_rows
from benchmarks.options import Options
from benchmarks.resident_memory import resident_bytes
from benchmarks.start_up import phase_seconds, render
from benchmarks.start_up_phases import PHASES
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


def test_no_round_begins_after_the_time_but_for_the_fewest(monkeypatch):
    now = iter(range(10**6))
    monkeypatch.setattr(timer.time, "perf_counter", lambda: next(now))
    work = {"a": lambda: None}
    assert len(time_interleaved(work, 30, 2, max_seconds=0.0).seconds["a"]) == timer.MIN_ROUNDS
    rounds = len(time_interleaved(work, 30, 0, max_seconds=50.0).seconds["a"])
    assert timer.MIN_ROUNDS < rounds < 30
    timings = time_interleaved(work, 8, 0, max_seconds=10**5)
    assert len(timings.seconds["a"]) == len(timings.processor_seconds["a"]) == 8


@pytest.mark.slow
@pytest.mark.usefixtures("needs_opengl")
def test_a_start_is_its_phases_and_a_failure_says_why(tmp_path):
    path = tmp_path / "frame.png"
    phases = phase_seconds("rings", path, None)
    assert tuple(phases) == PHASES
    assert min(phases.values()) > 0.0
    assert path.read_bytes().startswith(b"\x89PNG")
    with pytest.raises(BenchmarkError, match="fresh process failed: error: ringz: no such"):
        render("ringz", path, None)
    with pytest.raises(BenchmarkError, match=r"without drawing failed: .*device 63"):
        idle_driver_rows(["rings"], Options(1, 0, device=63))


def test_memory_is_held_while_it_is_used():
    size, before = 2**26, resident_bytes()
    # straight from the system: what the allocator still has from before would not grow
    held = mmap.mmap(-1, size)
    assert resident_bytes() - before < size // 4
    for page in range(0, size, mmap.PAGESIZE):
        held[page] = 1
    touched = resident_bytes()
    held.close()
    assert min(touched - before, touched - resident_bytes()) >= 0.9 * size
