"""The drive's suite, run as little as can be: no times, only what must be there."""

import numpy as np
import pytest

from benchmarks import start_up
from benchmarks.errors import BenchmarkError
from benchmarks.options import Options
from benchmarks.report import bound_lines, check
from benchmarks.start_up_phases import PHASES
from benchmarks.suites import drive
from omnisim.plots.style import write_plot
from tests.conftest import open_context_or_skip


@pytest.fixture(scope="module")
def report():
    open_context_or_skip().release()
    return drive.run(Options(warm_up=1), frames={"fast": 6, "default": 2}, starts=0)


@pytest.mark.slow
def test_report_has_every_frame_of_the_drive(report, tmp_path):
    check(report)
    frames = {row["setting"]: row for row in report["rows"] if row["kind"] == "frames"}
    assert report["scene"] == drive.SCENE
    assert {setting: row["rounds"] for setting, row in frames.items()} == {"fast": 6, "default": 2}
    for setting, row in frames.items():
        times = report["series"][setting]["frame"]
        assert len(times) == row["rounds"]
        assert row["p50_ms"] == pytest.approx(np.median(times), abs=1e-3)
        assert row["p50_ms"] <= row["p95_ms"] <= row["p99_ms"]
        assert max(row["slow_by_view"], row["slow_with_machine"]) <= row["slow"]
    write_plot(tmp_path / "drive.png", drive.figure(report))
    assert (tmp_path / "drive.png").stat().st_size > 0


@pytest.mark.slow
def test_fast_frames_and_memory_are_held(report):
    fast, processor, growth, growth_by_default = report["bounds"]
    assert fast["value"] == report["rows"][0]["p99_to_p50"]
    assert fast["bound"] is None
    assert processor["value"] == report["rows"][0]["processor_to_machine"]
    assert 0.0 < processor["value"] <= report["rows"][0]["processor_p99_to_p50"]
    memory = [row for row in report["rows"] if row["kind"] == "memory"]
    assert [growth["value"], growth_by_default["value"]] == [row["growth_mib"] for row in memory]
    for row in memory:
        assert row["most_mib"] >= max(row["settled_mib"], row["end_mib"]) > 10.0
    assert len(bound_lines(report)) == 1 + 4


@pytest.mark.slow
def test_start_up_is_reported_and_bounded(report, monkeypatch):
    runs = {True: start_up.Run(1.0, 2.0, ""), False: start_up.Run(2.0, 3.0, "")}
    monkeypatch.setattr(start_up, "render", lambda *_, cached=True: runs[cached])
    monkeypatch.setattr(start_up, "phase_seconds", lambda *_: dict.fromkeys(PHASES, 0.25))
    rows = start_up.start_up_rows("rings", 3, Options())
    assert [(row["what"], row["seconds"]) for row in rows[:2]] == [
        (start_up.CACHED, 1.0),
        (start_up.ANEW, 2.0),
    ]
    assert {row["what"] for row in rows[2:]} == set(PHASES)
    ((name, value, limits),) = drive._judged(rows)
    assert (name, value, limits.goal) == ("start to first image, s", 1.0, 1.5)
    lines = "\n".join(drive.lines({**report, "rows": [*report["rows"], *rows]}))
    assert "start-up, shaders compiled anew: 2.00 s (3.00 s of the processor)" in lines


def test_a_scene_without_a_path_cannot_be_driven_through():
    with pytest.raises(BenchmarkError, match="expected a scene with a path, got rings"):
        drive.run(Options(scenes=("rings",)), starts=0)


def test_unevenness_is_that_of_the_slowest_percent():
    assert drive.unevenness(np.full(500, 0.2)) == 1.0
    assert drive.unevenness(np.array([1.0] * 490 + [3.0] * 10)) == pytest.approx(3.0)
    assert drive.unevenness(np.array([1.0] * 496 + [3.0] * 4)) == pytest.approx(1.0)


def test_running_median_follows_the_view_and_not_a_single_frame():
    slope = np.linspace(1.0, 2.0, 200)
    jumped = slope.copy()
    jumped[100] = 9.0
    usual = drive.running_median(jumped)
    assert usual.shape == slope.shape
    assert np.abs(usual - slope).max() < 0.05
    assert drive.running_median(np.array([2.0])).tolist() == [2.0]
    assert drive.running_median(np.array([2.0, 3.0])).shape == (2,)
