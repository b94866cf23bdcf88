"""Report of a suite: one schema for all suites, verified by `check`.

| key | content |
| --- | --- |
| `suite` | name of the suite |
| `schema` | 1: this table |
| `rows` | one per measured variant: names and numbers, nothing nested |
| `bounds` | measures with a bound: `name`, `value`, `bound`, `sense`, `passed` and more |
| `passed` | true if all bounds hold |
| `rounds` | timed rounds; a row's own number takes precedence |
| `machine` | machine and versions, see `omnisim.validation.report.machine` |

A suite may add further keys.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, get_args

import moderngl

from benchmarks.errors import BenchmarkError
from benchmarks.options import Options
from omnisim.core.errors import OutputError
from omnisim.rendering.opengl.gl.context import graphics_info
from omnisim.validation.plots.plot_file import Figure, write_plot
from omnisim.validation.report.machine import describe_machine
from omnisim.validation.report.measure import Measure, Sense
from omnisim.validation.report.report import write_json

SCHEMA = 1
_KINDS = {
    "suite": str, "schema": int, "rows": list, "bounds": list, "passed": bool, "rounds": int,
    "machine": dict,
}  # fmt: skip
_MACHINE_KEYS = (
    "name", "processor", "cores", "load", "renderer", "opengl", "is_software", "commit",
)  # fmt: skip
_BOUND_KEYS = ("name", "value", "bound", "sense", "passed")  # of every version of the schema
_PLAIN = (str, bool, int, float, type(None))


def make_report(
    suite: str,
    options: Options,
    context: moderngl.Context,
    rows: Sequence[Mapping[str, Any]],
    bounds: Sequence[Measure] = (),
    **more: Any,
) -> dict[str, Any]:
    """Make the report of a suite, in the schema above.

    Args:
        suite: name of the suite.
        options: options of the run.
        context: OpenGL context of the run.
        rows: measured variants.
        bounds: measures with a bound.
        more: further results.
    """
    return {
        "suite": suite,
        "schema": SCHEMA,
        "rounds": options.rounds,
        **more,
        "rows": [dict(row) for row in rows],
        "bounds": [bound.as_dict() for bound in bounds],
        "passed": all(bound.passed for bound in bounds),
        "machine": describe_machine(graphics_info(context), options.device),
    }


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
    if report["passed"] is not all(bound["passed"] for bound in report["bounds"]):
        raise BenchmarkError(f"{name}: passed = {report['passed']}: its bounds say otherwise")
    for key in _MACHINE_KEYS:
        if key not in report["machine"]:
            raise BenchmarkError(f"{name}: machine: {key} is missing")
    try:
        json.dumps(report, allow_nan=False)
    except (TypeError, ValueError) as reason:
        raise BenchmarkError(f"{name}: is no JSON: {reason}") from None


def bound_lines(report: Mapping[str, Any]) -> list[str]:
    """Bounds as text, one line each."""
    return [
        f"{'holds' if one['passed'] else 'FAILS'}: {one['name']}: {one['value']:.3g}, "
        f"expected {one['sense']} {one['bound']:g}"
        for one in report["bounds"]
    ]


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
    for key in ("value", "bound"):
        if type(bound[key]) not in (int, float) or not math.isfinite(bound[key]):
            raise BenchmarkError(f"{where}: {key}: expected a finite number, got {bound[key]!r}")
    at_least = bound["sense"] == "at least"
    if Measure("", bound["value"], "", bound["bound"], at_least).passed is not bound["passed"]:
        raise BenchmarkError(f"{where}: passed = {bound['passed']}: its value says otherwise")
