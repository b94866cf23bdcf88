"""The live page's suite, run as little as can be: no times, only what must be there."""

import pytest

from benchmarks.options import Options
from benchmarks.report import check
from benchmarks.suites import live
from omnisim.plots.style import write_plot


@pytest.mark.slow
@pytest.mark.usefixtures("needs_opengl")
def test_every_number_of_the_page_is_measured_and_bounded(tmp_path, monkeypatch):
    monkeypatch.setattr(live, "DRIVE_S", 0.1)
    monkeypatch.setattr(live, "SIZE_PX", 64)
    report = live.run(Options(rounds=1, warm_up=0, scenes=("rings",)))
    check(report)
    assert [row["unit"] for row in report["rows"]] == ["1/s", "1/s", "ms", "ms", "s", "kB"]
    assert all(row["value"] > 0.0 for row in report["rows"])
    assert len(report["bounds"]) == len(report["rows"])
    assert len(live.lines(report)) == 2 * len(report["rows"]) + 1
    write_plot(tmp_path / "live.png", live.figure(report))
    assert (tmp_path / "live.png").stat().st_size > 0
