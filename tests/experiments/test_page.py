"""The page: numbers with their bounds, the paper's beside them, all or nothing."""

import json
import math

import pytest
from matplotlib.figure import Figure

from omnisim.errors import OutputError
from omnisim.experiments.page import Number, Page, Picture, Section, Table, check_folder


def _page(value):
    section = Section(
        "One & two", "What was done.",
        (Number("error", value, "m", 0.5, paper="0.349 m"), Number("count", 3.0)),
        (Table("Side by side.", ("a", "b"), (("x", "1"),)),),
        (Picture("dots", Figure(figsize=(1, 1)), "A dot."),),
        ("Mind the <gap>.",),
    )  # fmt: skip
    return Page("Title", "Words.", (section,), {"seed": 1})


def test_a_page_tells_whether_bounds_hold(tmp_path):
    page = _page(0.4)
    assert page.missed == []
    path = page.write(tmp_path / "out")
    html = path.read_text()
    assert "One &amp; two" in html
    assert "Mind the &lt;gap&gt;" in html
    assert "0.349 m" in html
    assert "Not every bound holds" not in html
    told = json.loads((tmp_path / "out" / "report.json").read_text())
    assert told["sections"][0]["numbers"][0]["passed"] is True
    assert (tmp_path / "out" / "dots.png").stat().st_size > 0


@pytest.mark.parametrize("value", [0.6, math.nan])
def test_a_missed_bound_is_told(tmp_path, value):
    page = _page(value)
    assert [number.name for number in page.missed] == ["error"]
    html = page.write(tmp_path).read_text()
    assert "Not every bound holds: error." in html
    told = json.loads((tmp_path / "report.json").read_text())
    assert told["sections"][0]["numbers"][0]["passed"] is False


def test_a_place_that_cannot_be_is_refused_early(tmp_path):
    with pytest.raises(OutputError, match="does not exist"):
        check_folder(tmp_path / "none" / "out")
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError):
        _page(0.1).write(tmp_path / "file")
