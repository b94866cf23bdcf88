"""The schema of reports, and refusal of anything else."""

import copy
import math

import pytest

from benchmarks.errors import BenchmarkError
from benchmarks.options import Options
from benchmarks.report import (
    bound_lines,
    check,
    make_report,
    read_report,
)
from omnisim.rendering.opengl.gl.context import graphics_info
from omnisim.validation.report.machine import describe_machine, machine_line
from omnisim.validation.report.measure import Measure


@pytest.fixture
def report(context):
    bounds = [Measure("share", 0.9, "", 0.97, at_least=True), Measure("cost", 1.1, "", 1.15)]
    rows = [{"camera": "a", "p50_ms": 2.0, "polygons": None}]
    return make_report("some", Options(rounds=3), context, rows, bounds, remark="why")


def test_report_follows_its_schema_and_names_missed_bounds(report):
    check(report)
    assert [bound["passed"] for bound in report["bounds"]] == [False, True]
    assert report["passed"] is False
    assert report["rounds"] == 3
    assert report["remark"] == "why"
    assert bound_lines(report) == [
        "FAILS: share: 0.9, expected at least 0.97",
        "holds: cost: 1.1, expected at most 1.15",
    ]


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
        (_with(2, "schema"), "schema: expected 1, got 2"),
        (_with([], "rows"), "rows: expected at least one, got none"),
        (
            _with(float("nan"), "rows", 0, "p50_ms"),
            r"rows\[0\]: p50_ms: expected .* finite number, got nan",
        ),
        (_with({"a": 1}, "rows", 0, "p50_ms"), r"rows\[0\]: p50_ms"),
        (_without("bounds", 1, "sense"), r"bounds\[1\]: expected name"),
        (_with("more", "bounds", 1, "sense"), "sense: expected at least or at most, got 'more'"),
        (_with(True, "bounds", 0, "passed"), "its value says otherwise"),
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


def test_a_value_that_is_no_number_holds_no_bound():
    assert not Measure("x", math.nan, "", 1.0, at_least=True).passed
    assert not Measure("x", math.nan, "", 1.0).passed


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
