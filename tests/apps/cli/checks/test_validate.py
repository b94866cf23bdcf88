"""`omnisim validate`: output, files and errors."""

import json
import math

import pytest

from omnisim.report.report import Measure, Section
from omnisim.validation import check_registry, oracles


@pytest.mark.usefixtures("needs_opengl")
def test_report_is_complete(omnisim, tmp_path):
    status, out, error = omnisim("validate", "-o", "report", "--only", "viewpoint")
    assert (status, error) == (0, "")
    assert "passed   Single viewpoint" in out
    assert "report/report.html: 1 passed" in out
    report = json.loads((tmp_path / "report" / "report.json").read_text())
    assert report["passed"]
    assert "Orientation" in report["facts"]["left_out"]
    assert report["machine"]["renderer"]
    (check,) = report["sections"]
    assert check["status"] == "passed"
    assert {"name", "value", "bound", "unit", "sense", "passed", "paper"} == set(
        check["measures"][0]
    )
    page = (tmp_path / "report" / "report.html").read_text()
    assert page.count("data:image/png;base64,") == len(check["figures"]) == 1
    assert 'src="http' not in page  # one file that holds everything
    for figure in check["figures"]:
        assert (tmp_path / "report" / figure["file"]).stat().st_size > 1000
        assert figure["caption"] in page


@pytest.mark.usefixtures("needs_opengl")
def test_a_missed_bound_is_printed_and_is_the_exit_status(omnisim, tmp_path, monkeypatch):
    section = Section("Fig. 7", "<b>Wrong</b> on purpose.", (Measure("miss", math.nan, "px", 1.0),))
    monkeypatch.setattr(check_registry.Check, "run", lambda self, fixture: section)
    status, out, _ = omnisim("validate", "-o", "report", "--only", "rings")
    assert status == 1
    assert "failed   Fig. 7" in out
    assert "missed miss: not a number ≤ 1 px" in out
    assert json.loads((tmp_path / "report" / "report.json").read_text())["passed"] is False
    page = (tmp_path / "report" / "report.html").read_text()
    assert "Not every bound holds" in page
    assert "&lt;b&gt;Wrong" in page


@pytest.mark.usefixtures("needs_opengl")
def test_a_missing_oracle_is_skipped_and_reported_first(omnisim, tmp_path, monkeypatch):
    monkeypatch.setattr(oracles, "import_failure", lambda name: f"{name} is not installed: pip")
    status, out, error = omnisim(
        "validate", "-o", "report", "--only", "omnidir", "--only", "viewpoint"
    )
    assert (status, error) == (0, "")
    assert "skipped  A calibration library" in out
    assert "cv2.omnidir is not installed: pip" in out
    assert "report/report.html: 1 passed, 1 skipped" in out
    report = json.loads((tmp_path / "report" / "report.json").read_text())
    reasons = {section["key"]: section["reason"] for section in report["sections"]}
    assert reasons == {"omnidir": "cv2.omnidir is not installed: pip", "viewpoint": ""}
    page = (tmp_path / "report" / "report.html").read_text()
    assert page.index("Not checked") < page.index("<h2")


@pytest.mark.usefixtures("needs_opengl")
def test_a_report_without_checks_does_not_claim_success(omnisim, tmp_path, monkeypatch):
    monkeypatch.setattr(oracles, "import_failure", lambda name: f"{name} is not installed: pip")
    status, _, _ = omnisim("validate", "-o", "report", "--only", "omnidir")
    assert status == 0
    page = (tmp_path / "report" / "report.html").read_text()
    assert "Nothing was checked" in page
    assert "Every bound holds" not in page
    assert "Left out: Fig. 7" in page


def test_without_opengl_no_check_starts(omnisim, tmp_path):
    status, out, error = omnisim("validate", "-o", "report", "--only", "viewpoint", "--device", 99)
    assert (status, out) == (1, "")
    assert error.count("\n") == 1
    assert not (tmp_path / "report").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["-o", "report", "--only", "ring"],
            "--only: expected a check, got 'ring'; did you mean 'rings'?",
        ),
        (["-o", "file"], "file: is a file: expected a folder"),
    ],
)
def test_bad_input_gets_one_line(omnisim, tmp_path, arguments, message):
    (tmp_path / "file").touch()
    status, _, error = omnisim("validate", *arguments)
    assert status == 1
    assert error.startswith("error: ")
    assert message in error
    assert error.count("\n") == 1


@pytest.mark.usefixtures("needs_opengl")
def test_a_failing_oracle_fails_its_check_alone(omnisim, tmp_path, monkeypatch):
    true_run = check_registry.Check.run

    def run(self, fixture):
        if self.key == "omnidir":
            raise RuntimeError("lost\nin <there>")
        return true_run(self, fixture)

    monkeypatch.setattr(check_registry.Check, "run", run)
    monkeypatch.setattr(check_registry.Check, "skip_reason", lambda self: "")
    status, out, _ = omnisim("validate", "-o", "report", "--only", "omnidir", "--only", "viewpoint")
    assert status == 1
    assert "failed   A calibration library" in out
    assert "RuntimeError: lost in <there>" in out
    assert "1 passed, 1 failed" in out
    page = (tmp_path / "report" / "report.html").read_text()
    assert "failed: RuntimeError: lost in &lt;there&gt;" in page
