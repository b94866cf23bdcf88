"""Report of a suite: one schema for all suites, verified by `check`.

| key | content |
| --- | --- |
| `suite` | name of the suite |
| `schema` | 2: this table |
| `rows` | one per measured variant: names and numbers, nothing nested |
| `bounds` | judged numbers, see `benchmarks.bounds`; null: no interval, bound or goal |
| `passed` | true if all bounds hold; goals do not count |
| `rounds` | timed rounds; a row's own number takes precedence |
| `machine` | machine and versions, see `omnisim.report.machine` |

A suite may add further keys.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, get_args

import moderngl

from benchmarks.bounds import Limits, Sense, entry_cells, is_number, passes, reaches_goal
from benchmarks.errors import BenchmarkError
from benchmarks.options import Options
from benchmarks.timer import MedianInterval
from omnisim.core.errors import OutputError
from omnisim.plots.style import Figure, write_plot
from omnisim.rendering.opengl.gl.context import graphics_info
from omnisim.report.machine import describe_machine
from omnisim.report.report import write_json

SCHEMA = 2
Judged = tuple[str, float | MedianInterval, Limits]  # name, value, and what it should be
_KINDS = {
    "suite": str, "schema": int, "rows": list, "bounds": list, "passed": bool, "rounds": int,
    "machine": dict,
}  # fmt: skip
_MACHINE_KEYS = (
    "name", "processor", "cores", "load", "renderer", "opengl", "is_software", "commit",
)  # fmt: skip
_BOUND_KEYS = ("name", "value", "low", "high", "sense", "bound", "goal", "reason", "passed")
_PLAIN = (str, bool, int, float, type(None))


def make_report(
    suite: str,
    options: Options,
    context: moderngl.Context,
    rows: Sequence[Mapping[str, Any]],
    judged: Sequence[Judged] = (),
    **more: Any,
) -> dict[str, Any]:
    """Make the report of a suite, in the schema above.

    Args:
        suite: name of the suite.
        options: options of the run.
        context: OpenGL context of the run.
        rows: measured variants.
        judged: numbers with a bound or a goal.
        more: further results.
    """
    machine = describe_machine(graphics_info(context), options.device)
    judgments = [
        limits.judge(name, value, machine["is_software"]) for name, value, limits in judged
    ]
    bounds = [
        judgment
        for judgment in judgments
        if judgment["bound"] is not None or judgment["goal"] is not None
    ]
    return {
        "suite": suite,
        "schema": SCHEMA,
        "rounds": options.rounds,
        **more,
        "rows": [dict(row) for row in rows],
        "bounds": bounds,
        "passed": _all_hold(bounds),
        "machine": machine,
    }


def _all_hold(bounds: Sequence[Mapping[str, Any]]) -> bool:
    return all(entry["passed"] is not False for entry in bounds)


def check(report: Mapping[str, Any]) -> None:
    """Verify a report against the schema.

    Raises:
        BenchmarkError: the message names suite, key and expected value.
    """
    name = report.get("suite", "report")
    for key, kind in _KINDS.items():
        if type(report.get(key)) is not kind:
            raise BenchmarkError(
                f"{name}: {key}: expected {kind.__name__}, got {report.get(key)!r}"
            )
    if report["schema"] != SCHEMA:
        raise BenchmarkError(f"{name}: schema: expected {SCHEMA}, got {report['schema']}")
    if not report["rows"]:
        raise BenchmarkError(f"{name}: rows: expected at least one, got none")
    for at, row in enumerate(report["rows"]):
        _check_row(row, f"{name}: rows[{at}]")
    for at, bound in enumerate(report["bounds"]):
        _check_bound(bound, f"{name}: bounds[{at}]")
    if report["passed"] is not _all_hold(report["bounds"]):
        raise BenchmarkError(f"{name}: passed = {report['passed']}: its bounds say otherwise")
    for key in _MACHINE_KEYS:
        if key not in report["machine"]:
            raise BenchmarkError(f"{name}: machine: {key} is missing")
    try:
        json.dumps(report, allow_nan=False)
    except (TypeError, ValueError) as reason:
        raise BenchmarkError(f"{name}: is no JSON: {reason}") from None


def bound_lines(report: Mapping[str, Any]) -> list[str]:
    """Table of the judged numbers, a line each; a bound that does not hold says FAILS."""
    if not report["bounds"]:
        return []
    rows = [("", "measured", "bound", "goal"), *map(entry_cells, report["bounds"])]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]


def failures(report: Mapping[str, Any]) -> list[str]:
    """Name, value and bound of each bound that does not hold."""
    cells = [entry_cells(entry) for entry in report["bounds"] if entry["passed"] is False]
    return [f"{name} is {value}, bound {bound}" for name, value, bound, _ in cells]


def verdict(reports: Sequence[Mapping[str, Any]]) -> str:
    """Numbers of bounds that hold and goals that are reached, in one line."""
    entries = [entry for report in reports for entry in report["bounds"]]
    hold = [entry["passed"] for entry in entries if entry["bound"] is not None]
    reached = [reaches_goal(entry) for entry in entries if entry["goal"] is not None]
    return (
        f"{hold.count(True)} of {len(hold)} bounds hold; "
        f"{reached.count(True)} of {len(reached)} goals are reached"
    )


def write_report(folder: Path, report: Mapping[str, Any], figure: Figure) -> None:
    """Write `<suite>.json` and `<suite>.png` into a folder; each atomically.

    Raises:
        BenchmarkError: the report does not match the schema.
        OutputError: a file cannot be written.
    """
    check(report)
    path = folder / f"{report['suite']}.json"
    write_json(path, report)
    write_plot(path.with_suffix(".png"), figure)


def read_report(path: Path) -> dict[str, Any]:
    """Read a report.

    Raises:
        OutputError: the file cannot be read.
        BenchmarkError: the file is not a report.
    """
    try:
        report = json.loads(path.read_text(encoding="utf-8"))
    except OSError as reason:
        raise OutputError(f"{path}: cannot be read: {reason.strerror}") from None
    except ValueError as reason:
        raise BenchmarkError(f"{path}: is no JSON: {reason}") from None
    if not isinstance(report, dict):
        raise BenchmarkError(f"{path}: expected a report, got {type(report).__name__}")
    check(report)
    return report


def _check_row(row: Any, where: str) -> None:
    if not isinstance(row, dict) or not row:
        raise BenchmarkError(f"{where}: expected names and numbers, got {row!r}")
    for key, value in row.items():
        if type(value) not in _PLAIN or (isinstance(value, float) and not math.isfinite(value)):
            raise BenchmarkError(
                f"{where}: {key}: expected a word or a finite number, got {value!r}"
            )


def _check_bound(bound: Any, where: str) -> None:
    if not isinstance(bound, dict) or not bound.keys() >= set(_BOUND_KEYS):
        raise BenchmarkError(f"{where}: expected {', '.join(_BOUND_KEYS)}, got {bound!r}")
    if bound["sense"] not in get_args(Sense):
        raise BenchmarkError(
            f"{where}: sense: expected {' or '.join(get_args(Sense))}, got {bound['sense']!r}"
        )
    for key in ("value", "low", "high", "bound", "goal"):
        if not is_number(bound[key]) and (key == "value" or bound[key] is not None):
            raise BenchmarkError(f"{where}: {key}: expected a finite number, got {bound[key]!r}")
    if bound["bound"] is None and bound["goal"] is None:
        raise BenchmarkError(f"{where}: expected a bound or a goal, got neither")
    if passes(bound) is not bound["passed"]:
        raise BenchmarkError(f"{where}: passed = {bound['passed']}: its value says otherwise")
