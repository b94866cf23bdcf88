"""Report: measures with their bounds, the paper's values beside them, all or nothing."""

import json
import math
import re

import pytest
from matplotlib.figure import Figure

from omnisim.core.errors import OutputError
from omnisim.rendering.opengl.gl.context import graphics_info
from omnisim.report import machine
from omnisim.report.report import (
    CaptionedFigure,
    Measure,
    Report,
    ResultTable,
    Section,
    check_report_target,
)


def _report(value):
    section = Section(
        "One & two", "What was done.",
        (Measure("error", value, "m", 0.5, paper="0.349 m"), Measure("count", 3.0)),
        (ResultTable("Side by side.", ("a", "b"), (("x", "1"),)),),
        (CaptionedFigure("dots", Figure(figsize=(1, 1)), "A dot."),),
        ("Mind the <gap>.",),
    )  # fmt: skip
    return Report("Title", "Words.", (section,), {"seed": 1})


def test_a_report_tells_whether_bounds_hold(tmp_path):
    report = _report(0.4)
    assert report.missed == []
    report.write(tmp_path / "out")
    html = (tmp_path / "out" / "report.html").read_text()
    assert "One &amp; two" in html
    assert "Mind the &lt;gap&gt;" in html
    assert "0.349 m" in html
    assert "Every bound holds." in html
    content = json.loads((tmp_path / "out" / "report.json").read_text())
    assert content["sections"][0]["measures"][0]["passed"] is True
    assert content["facts"] == {"seed": 1}
    assert (tmp_path / "out" / "dots.png").stat().st_size > 0


@pytest.mark.parametrize("value", [0.6, math.nan])
def test_a_missed_bound_is_named(tmp_path, value):
    report = _report(value)
    assert [measure.name for measure in report.missed] == ["error"]
    report.write(tmp_path)
    assert "Not every bound holds: error." in (tmp_path / "report.html").read_text()
    content = json.loads((tmp_path / "report.json").read_text())
    assert content["sections"][0]["measures"][0]["passed"] is False
    assert content["passed"] is False


def test_a_report_without_bounds_has_no_verdict():
    assert Report("", "", (Section("a", "", (Measure("count", 3.0),)),)).verdict == ""


def test_columns_of_numbers_are_told_from_text():
    rows = (("a", "1.5", "0.3 px", "", "4800 pixels at 6 times"), ("b", "–", "-2 px", "±3", "9"))
    assert ResultTable("", tuple("abcde"), rows).are_numbers == (False, True, True, True, False)
    assert ResultTable("", ("a",), ()).are_numbers == ()


def test_a_place_that_cannot_be_is_refused_early(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="file: is a file: expected a folder"):
        check_report_target(tmp_path / "file" / "out")
    with pytest.raises(OutputError):
        _report(0.1).write(tmp_path / "file")


def test_a_section_without_bounds_did_not_pass_them():
    without = Section("Errors", "", (Measure("drift", 1.0, "%"),))
    assert without.status == Report("", "", [without]).status == "measured"
    with_bound = Section("Bounds", "", (Measure("drift", 1.0, "%", 2.0),))
    assert Report("", "", [without, with_bound]).status == "passed"


@pytest.mark.parametrize("value", [3.0, 0.1, math.nan])
def test_what_was_not_measured_neither_passes_nor_fails(tmp_path, value):
    noise = Measure("noise", value, "levels", 0.5, unmeasured="no noise in the file")
    held = Measure("corners", 0.01, "px", 0.05)
    missed = Measure("edges", 20.0, "%", 15.0)
    assert noise.passed is None
    alone = Report("", "", (Section("a", "", (noise,)),))
    assert (alone.status, alone.verdict, alone.passed) == ("measured", "", True)
    both = Report("", "", (Section("a", "", (held, noise)),))
    assert (both.status, both.verdict) == ("passed", "Every bound that was checked holds.")
    all_three = Report("", "", (Section("a", "", (held, noise, missed)),))
    assert (all_three.status, all_three.verdict) == ("failed", "Not every bound holds: edges.")
    both.write(tmp_path)
    page = (tmp_path / "report.html").read_text()
    assert "not measured: no noise in the file" in page
    assert "missed" not in page
    (_, written) = json.loads((tmp_path / "report.json").read_text())["sections"][0]["measures"]
    assert (written["passed"], written["unmeasured"]) == (None, "no noise in the file")


def test_commits_are_looked_up_in_the_checkout():
    assert (machine.ROOT / "pyproject.toml").is_file()


def test_a_machine_is_told_by_its_renderer_and_a_name_fit_for_files(context):
    described = machine.describe_machine(graphics_info(context))
    assert described["renderer"] == context.info["GL_RENDERER"]
    assert described["is_software"] is ("llvmpipe" in described["renderer"])
    assert re.fullmatch("[a-z0-9-]+", described["name"])
    assert described["renderer"] in machine.machine_line(described)
