"""The schema of reports, and refusal of anything else."""

import copy
import math

import pytest

from benchmarks.bounds import Limits
from benchmarks.errors import BenchmarkError
from benchmarks.options import Options
from benchmarks.report import (
    bound_lines,
    check,
    make_report,
    read_report,
    verdict,
)
from omnisim.rendering.opengl.gl.context import graphics_info
from omnisim.report.machine import describe_machine, machine_line


@pytest.fixture
def report(context):
    judged = [
        ("share", 0.9, Limits(0.95, 0.97, at_least=True, reason="why")),
        ("cost", 1.1, Limits(1.15, 1.0)),
        ("wish", 3.0, Limits(goal=4.0)),
    ]
    rows = [{"camera": "a", "p50_ms": 2.0, "polygons": None}]
    return make_report("some", Options(rounds=3), context, rows, judged, remark="why")


def test_report_follows_its_schema_and_names_missed_bounds(report):
    check(report)
    assert [bound["passed"] for bound in report["bounds"]] == [False, True, None]
    assert report["passed"] is False
    assert report["rounds"] == 3
    assert report["remark"] == "why"
    assert bound_lines(report) == [
        "       measured  bound          goal",
        "share  0.9       ≥ 0.95: FAILS  ≥ 0.97: 1.08 × off",
        "cost   1.1       ≤ 1.15: holds  ≤ 1: 1.1 × off",
        "wish   3                        ≤ 4: reached",
    ]
    assert verdict([report, report]) == "2 of 4 bounds hold; 2 of 6 goals are reached"


def test_on_a_gpu_bounds_of_software_are_left_out(context, monkeypatch):
    monkeypatch.setattr("omnisim.report.machine.SOFTWARE", ("another renderer",))
    limits = {"bound": 1.0, "software_only": True}
    judged = [("a", 9.0, Limits(**limits)), ("b", 9.0, Limits(**limits, goal=0.5))]
    report = make_report("some", Options(), context, [{"a": 1}], judged)
    check(report)
    assert [(one["name"], one["bound"], one["goal"]) for one in report["bounds"]] == [
        ("b", None, 0.5)
    ]
    assert report["passed"] is True


def test_missed_goals_are_no_failure(context):
    judged = [("wish", 5.0, Limits(goal=4.0)), ("cost", 1.0, Limits(2.0, 0.5))]
    report = make_report("some", Options(), context, [{"a": 1}], judged)
    check(report)
    assert report["passed"] is True


def _without(*keys):
    def change(report):
        *way, last = keys
        for key in way:
            report = report[key]
        del report[last]

    return change


def _with(value, *keys):
    def change(report):
        *way, last = keys
        for key in way:
            report = report[key]
        report[last] = value

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (_without("suite"), "suite: expected str, got None"),
        (_with(1, "schema"), "schema: expected 2, got 1"),
        (_with([], "rows"), "rows: expected at least one, got none"),
        (
            _with(float("nan"), "rows", 0, "p50_ms"),
            r"rows\[0\]: p50_ms: expected .* finite number, got nan",
        ),
        (_with({"a": 1}, "rows", 0, "p50_ms"), r"rows\[0\]: p50_ms"),
        (_without("bounds", 1, "sense"), r"bounds\[1\]: expected name"),
        (_with("more", "bounds", 1, "sense"), "sense: expected at least or at most, got 'more'"),
        (_with(True, "bounds", 0, "passed"), "its value says otherwise"),
        (_with(None, "bounds", 2, "goal"), r"bounds\[2\]: expected a bound or a goal"),
        (_with(math.inf, "bounds", 1, "goal"), "goal: expected a finite number, got inf"),
        (_with(True, "passed"), "its bounds say otherwise"),
        (_without("machine", "renderer"), "machine: renderer is missing"),
        (_with({1, 2}, "remark"), "is no JSON"),
    ],
)
def test_reports_that_break_the_schema_are_refused(report, change, message):
    changed = copy.deepcopy(report)
    change(changed)
    with pytest.raises(BenchmarkError, match=message):
        check(changed)


def test_a_file_that_is_no_report_is_refused(tmp_path):
    path = tmp_path / "fps.json"
    path.write_text("[1]", encoding="utf-8")
    with pytest.raises(BenchmarkError, match="expected a report, got list"):
        read_report(path)
    path.write_text("{", encoding="utf-8")
    with pytest.raises(BenchmarkError, match="is no JSON"):
        read_report(path)


def test_machine_names_the_renderer(context):
    machine = describe_machine(graphics_info(context))
    assert machine["renderer"] == context.info["GL_RENDERER"]
    assert machine["is_software"] is ("llvmpipe" in machine["renderer"])
    assert machine["name"]
    assert not set(machine["name"]) - set("abcdefghijklmnopqrstuvwxyz0123456789-")
    assert machine["renderer"] in machine_line(machine)


def test_impossible_options_are_refused():
    for wrong in ({"rounds": 0}, {"warm_up": -1}, {"device": -1}):
        with pytest.raises(BenchmarkError, match="expected"):
            Options(**wrong)


def test_fewer_rounds_are_never_more_than_were_asked_for():
    assert (Options(30, 20).fewer(5).rounds, Options(30, 20).fewer(5).warm_up) == (6, 4)
    assert (Options(2, 1).fewer(5).rounds, Options(2, 1).fewer(5).warm_up) == (2, 1)
    assert Options(600, 20).fewer(5).rounds == 120
