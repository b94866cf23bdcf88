"""Measurements of processes: start-up, memory, garbage collection."""

import gc
import mmap

import pytest

from benchmarks.collector_watch import watching_the_collector
from benchmarks.errors import BenchmarkError
from benchmarks.resident_memory import resident_bytes
from benchmarks.start_up import phase_seconds, render
from benchmarks.start_up_phases import PHASES


@pytest.mark.usefixtures("needs_opengl")
def test_a_start_is_its_phases(tmp_path):
    path = tmp_path / "frame.png"
    phases = phase_seconds("rings", path, None)
    assert tuple(phases) == PHASES
    assert min(phases.values()) > 0.0
    assert path.read_bytes().startswith(b"\x89PNG")


def test_a_start_that_fails_says_why(tmp_path):
    with pytest.raises(BenchmarkError, match="fresh process failed: error: ringz: no such"):
        render("ringz", tmp_path / "frame.png", None)


def test_memory_is_held_while_it_is_used():
    size = 2**26
    before = resident_bytes()
    # straight from the system: what the allocator still has from before would not grow
    held = mmap.mmap(-1, size)
    reserved = resident_bytes()
    for page in range(0, size, mmap.PAGESIZE):
        held[page] = 1
    touched = resident_bytes()
    held.close()
    assert reserved - before < size // 4
    assert touched - reserved >= 0.9 * size
    assert touched - resident_bytes() >= 0.9 * size


def test_the_collector_is_watched_inside_of_the_block_only():
    with watching_the_collector() as watch:
        gc.collect()
        assert watch.collections == 1
        assert watch.seconds > 0.0
    gc.collect()
    assert watch.collections == 1
