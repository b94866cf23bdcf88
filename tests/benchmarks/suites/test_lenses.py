"""The lenses' suite, run as little as can be: no times, only what must be there."""

import pytest

from benchmarks.options import Options
from benchmarks.report import check
from benchmarks.suites import lenses
from omnisim.plots.style import write_plot
from tests.camera_examples import CAMERA_EXAMPLES


@pytest.mark.slow
@pytest.mark.usefixtures("needs_opengl")
def test_every_model_is_timed_and_the_slowest_is_bounded(tmp_path, monkeypatch):
    few = dict(list(CAMERA_EXAMPLES.items())[::7])  # each compiles a shader of its own
    monkeypatch.setattr(lenses, "CAMERA_EXAMPLES", few)
    report = lenses.run(Options(rounds=1, warm_up=0))
    check(report)
    assert {row["lens"] for row in report["rows"]} == {camera.model_name for camera in few.values()}
    assert len(report["rows"]) > 1
    ratios = [row["ratio"] for row in report["rows"]]
    assert report["bounds"][0]["value"] == max(ratios)
    assert len(lenses.lines(report)) == 1 + len(ratios) + 2
    write_plot(tmp_path / "lenses.png", lenses.figure(report))
    assert (tmp_path / "lenses.png").stat().st_size > 0
