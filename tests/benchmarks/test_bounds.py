"""Bounds that tell regressions, distances from goals, and the schema of reports."""

import copy
import math

import pytest

from benchmarks.bounds import Limits
from benchmarks.errors import BenchmarkError
from benchmarks.options import Options
from benchmarks.report import bound_lines, check, make_report, read_report, verdict
from benchmarks.timer import MedianInterval

FAST = Limits(bound=1.0, goal=2.5, at_least=True, software_only=True)
CHEAP = Limits(bound=1.4, goal=1.15)


@pytest.mark.parametrize(
    ("limits", "value", "passed"),
    [
        (FAST, 1.0, True),
        (FAST, MedianInterval(0.95, 0.9, 1.02), True),
        (CHEAP, 1.41, False),
        (CHEAP, MedianInterval(1.5, 1.39, 1.6), True),
        (CHEAP, MedianInterval(1.5, 1.41, 1.6), False),
        (Limits(goal=1.0), 7.0, None),
        (CHEAP, math.nan, False),
    ],
)
def test_a_bound_fails_if_its_whole_interval_misses_it(limits, value, passed):
    assert limits.judge("ratio", value)["passed"] is passed


@pytest.fixture
def report(context):
    judged = [
        ("share", 0.9, Limits(0.95, 0.97, at_least=True, reason="why")),
        ("cost", 1.1, Limits(1.15, 1.0)),
        ("wish", 3.0, Limits(goal=4.0)),
    ]
    rows = [{"camera": "a", "p50_ms": 2.0, "polygons": None}]
    return make_report("some", Options(rounds=3), context, rows, judged, remark="why")


def test_a_report_names_missed_bounds(report):
    check(report)
    assert report["passed"] is False
    assert bound_lines(report) == [
        "       measured  bound          goal",
        "share  0.9       ≥ 0.95: FAILS  ≥ 0.97: 1.08 × off",
        "cost   1.1       ≤ 1.15: holds  ≤ 1: 1.1 × off",
        "wish   3                        ≤ 4: reached",
    ]
    assert verdict([report, report]) == "2 of 4 bounds hold; 2 of 6 goals are reached"


def test_on_a_gpu_bounds_of_software_are_left_out(context, monkeypatch):
    monkeypatch.setattr("omnisim.report.machine.SOFTWARE", ("another renderer",))
    judged = [("a", 9.0, Limits(1.0, software_only=True)), ("b", 0.5, FAST)]
    report = make_report("some", Options(), context, [{"a": 1}], judged)
    check(report)
    assert [(one["name"], one["bound"], one["goal"]) for one in report["bounds"]] == [
        ("b", None, 2.5)
    ]
    assert report["passed"] is True


@pytest.mark.parametrize(
    ("way", "value", "message"),
    [
        (("schema",), 1, "schema: expected 2, got 1"),
        (("rows",), [], "rows: expected at least one, got none"),
        (("rows", 0, "p50_ms"), math.nan, r"rows\[0\]: p50_ms: expected .* finite number, got nan"),
        (("bounds", 0, "passed"), True, "its value says otherwise"),
        (("bounds", 2, "goal"), None, r"bounds\[2\]: expected a bound or a goal"),
        (("passed",), True, "its bounds say otherwise"),
        (("remark",), {1, 2}, "is no JSON"),
    ],
)
def test_reports_that_break_the_schema_are_refused(report, way, value, message):
    changed = part = copy.deepcopy(report)
    for key in way[:-1]:
        part = part[key]
    part[way[-1]] = value
    with pytest.raises(BenchmarkError, match=message):
        check(changed)


def test_files_and_options_that_cannot_be_are_refused(tmp_path):
    for text, message in (("[1]", "expected a report, got list"), ("{", "is no JSON")):
        (tmp_path / "fps.json").write_text(text, encoding="utf-8")
        with pytest.raises(BenchmarkError, match=message):
            read_report(tmp_path / "fps.json")
    assert (Options(30, 20).fewer(5).rounds, Options(2, 1).fewer(5).rounds) == (6, 2)
