"""`omnisim validate`: output, files and errors."""

import json
import math

import pytest

from omnisim.report.report import Measure, Section
from omnisim.validation import check_registry, oracles


def _checked(self, fixture):
    """Instead of a check: one that fails, one that misses its bound, and one that holds."""
    if self.key == "omnidir":
        raise RuntimeError("lost\nin <there>")
    value = math.nan if self.key == "rings" else 0.5
    measure = Measure("miss", value, "px", 1.0)
    return Section(self.title, "<b>Wrong</b> on purpose.", (measure,), key=self.key)


@pytest.mark.usefixtures("needs_opengl")
def test_report_is_complete(quiet, tmp_path):
    out = quiet("validate", "-o", "report", "--only", "viewpoint")
    assert "passed   Single viewpoint" in out
    assert "report/report.html: 1 passed" in out
    report = json.loads((tmp_path / "report" / "report.json").read_text())
    assert report["passed"]
    assert "Orientation" in report["facts"]["left_out"]
    assert report["machine"]["renderer"]
    (check,) = report["sections"]
    assert check["status"] == "passed"
    assert check["measures"][0].keys() == {
        "name", "value", "bound", "unit", "sense", "passed", "paper",
    }  # fmt: skip
    page = (tmp_path / "report" / "report.html").read_text()
    assert page.count("data:image/png;base64,") == len(check["figures"]) == 1
    assert 'src="http' not in page  # one file that holds everything
    for figure in check["figures"]:
        assert (tmp_path / "report" / figure["file"]).stat().st_size > 1000
        assert figure["caption"] in page


@pytest.mark.usefixtures("needs_opengl")
def test_a_missed_bound_and_a_failing_oracle_are_printed_and_are_the_exit_status(
    omnisim, tmp_path, monkeypatch
):
    monkeypatch.setattr(check_registry.Check, "run", _checked)
    monkeypatch.setattr(check_registry.Check, "skip_reason", lambda self: "")
    only = (word for key in ("omnidir", "rings", "viewpoint") for word in ("--only", key))
    status, out, _ = omnisim("validate", "-o", "report", *only)
    assert status == 1
    assert "failed   Fig. 7" in out
    assert "missed miss: not a number ≤ 1 px" in out
    assert "failed   A calibration library" in out
    assert "RuntimeError: lost in <there>" in out
    assert "1 passed, 2 failed" in out
    assert json.loads((tmp_path / "report" / "report.json").read_text())["passed"] is False
    page = (tmp_path / "report" / "report.html").read_text()
    assert "Not every bound holds" in page
    assert "&lt;b&gt;Wrong" in page
    assert "failed: RuntimeError: lost in &lt;there&gt;" in page


@pytest.mark.usefixtures("needs_opengl")
def test_a_missing_oracle_is_skipped_and_reported_first(quiet, tmp_path, monkeypatch):
    monkeypatch.setattr(oracles, "import_failure", lambda name: f"{name} is not installed: pip")
    monkeypatch.setattr(check_registry.Check, "run", _checked)
    out = quiet("validate", "-o", "report", "--only", "omnidir", "--only", "viewpoint")
    assert "skipped  A calibration library" in out
    assert "cv2.omnidir is not installed: pip" in out
    assert "report/report.html: 1 passed, 1 skipped" in out
    report = json.loads((tmp_path / "report" / "report.json").read_text())
    reasons = {section["key"]: section["reason"] for section in report["sections"]}
    assert reasons == {"omnidir": "cv2.omnidir is not installed: pip", "viewpoint": ""}
    page = (tmp_path / "report" / "report.html").read_text()
    assert page.index("Not checked") < page.index("<h2")
    quiet("validate", "-o", "empty", "--only", "omnidir")  # which does not claim success
    page = (tmp_path / "empty" / "report.html").read_text()
    assert "Nothing was checked" in page
    assert "Every bound holds" not in page
    assert "Left out: Fig. 7" in page


def test_bad_input_and_missing_opengl_end_in_one_line_before_a_check(refused, tmp_path):
    (tmp_path / "file").touch()
    refused("validate", "-o", "report", "--only", "viewpoint", "--device", 99)
    line = refused("validate", "-o", "report", "--only", "ring")
    assert line == "--only: expected a check, got 'ring'; did you mean 'rings'?"
    assert refused("validate", "-o", "file") == "file: is a file: expected a folder"
