"""A report: what every suite writes down, in one form, which `check` holds it to.

| key | what |
| --- | --- |
| `suite` | its name |
| `schema` | 1: this table |
| `rows` | one for each measured variant: names and numbers, nothing nested |
| `bounds` | one for each: `name`, `value`, `bound`, `sense`, `passed` |
| `passed` | whether all bounds hold |
| `rounds` | timed turns; where a row has its own, that one counts |
| `machine` | what it was measured on, see `machine.py` |

Whatever else a suite has to say has keys of its own.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import moderngl

from benchmarks.errors import BenchmarkError
from benchmarks.machine import about
from benchmarks.options import Options
from omnisim.atomic_file import atomic_write
from omnisim.errors import OutputError

SCHEMA = 1
AT_LEAST, AT_MOST = "at least", "at most"
_KINDS = {
    "suite": str, "schema": int, "rows": list, "bounds": list, "passed": bool, "rounds": int,
    "machine": dict,
}  # fmt: skip
_ABOUT = ("name", "processor", "cores", "load", "renderer", "opengl", "is_software", "commit")
_PLAIN = (str, bool, int, float, type(None))


class Bound(NamedTuple):
    """A number that is held to another."""

    name: str
    value: float
    bound: float
    sense: str  # AT_LEAST or AT_MOST

    @property
    def passed(self) -> bool:
        """Whether it holds; never, where the value is not a number."""
        if self.sense == AT_LEAST:
            return self.value >= self.bound
        return self.value <= self.bound

    def as_dict(self) -> dict[str, Any]:
        """For the report."""
        return {**self._asdict(), "passed": self.passed}


def make_report(
    suite: str,
    options: Options,
    context: moderngl.Context,
    rows: Sequence[Mapping[str, Any]],
    bounds: Sequence[Bound] = (),
    **more: Any,
) -> dict[str, Any]:
    """The report of a suite.

    Args:
        suite: its name.
        options: what it was run with.
        context: what it was run on.
        rows: see above.
        bounds: what it is held to.
        more: what else it has to say.
    """
    return {
        "suite": suite,
        "schema": SCHEMA,
        "rounds": options.rounds,
        **more,
        "rows": [dict(row) for row in rows],
        "bounds": [bound.as_dict() for bound in bounds],
        "passed": all(bound.passed for bound in bounds),
        "machine": about(context, options.device),
    }


def check(report: Mapping[str, Any]) -> None:
    """Hold a report to the schema.

    Raises:
        BenchmarkError: naming suite, key and what was wanted.
    """
    name = report.get("suite", "report")
    for key, kind in _KINDS.items():
        if type(report.get(key)) is not kind:
            raise BenchmarkError(f"{name}: {key} = {report.get(key)!r}: want {kind.__name__}")
    if report["schema"] != SCHEMA:
        raise BenchmarkError(f"{name}: schema = {report['schema']}: want {SCHEMA}")
    if not report["rows"]:
        raise BenchmarkError(f"{name}: rows: want at least one")
    for at, row in enumerate(report["rows"]):
        _check_row(row, f"{name}: rows[{at}]")
    for at, bound in enumerate(report["bounds"]):
        _check_bound(bound, f"{name}: bounds[{at}]")
    if report["passed"] is not all(bound["passed"] for bound in report["bounds"]):
        raise BenchmarkError(f"{name}: passed = {report['passed']}: its bounds say otherwise")
    for key in _ABOUT:
        if key not in report["machine"]:
            raise BenchmarkError(f"{name}: machine: {key} is missing")
    try:
        json.dumps(report, allow_nan=False)
    except (TypeError, ValueError) as reason:
        raise BenchmarkError(f"{name}: is no JSON: {reason}") from None


def bound_lines(report: Mapping[str, Any]) -> list[str]:
    """The bounds in words, a line each."""
    return [
        f"{'holds' if one['passed'] else 'FAILS'}: {one['name']}: {one['value']:.3g}, "
        f"want {one['sense']} {one['bound']:g}"
        for one in report["bounds"]
    ]


def write_report(folder: Path, suite: ModuleType, report: Mapping[str, Any]) -> None:
    """Write `<suite>.json` and `<suite>.png` into a folder; each appears only when it is whole.

    Raises:
        BenchmarkError: the report is not one.
        OutputError: a file cannot be written.
    """
    check(report)
    path = folder / f"{report['suite']}.json"
    with atomic_write(path) as partial:
        partial.write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")
    suite.plot(report, path.with_suffix(".png"))


def read_report(path: Path) -> dict[str, Any]:
    """Read a report back.

    Raises:
        OutputError: the file cannot be read.
        BenchmarkError: it is no report.
    """
    try:
        report = json.loads(path.read_text(encoding="utf-8"))
    except OSError as reason:
        raise OutputError(f"{path}: cannot be read: {reason.strerror}") from None
    except ValueError as reason:
        raise BenchmarkError(f"{path}: is no JSON: {reason}") from None
    if not isinstance(report, dict):
        raise BenchmarkError(f"{path}: is no report: want an object")
    check(report)
    return report


def _check_row(row: Any, where: str) -> None:
    if not isinstance(row, dict) or not row:
        raise BenchmarkError(f"{where}: want names and numbers")
    for key, value in row.items():
        if type(value) not in _PLAIN or (isinstance(value, float) and not math.isfinite(value)):
            raise BenchmarkError(f"{where}: {key} = {value!r}: want a word or a finite number")


def _check_bound(bound: Any, where: str) -> None:
    if not isinstance(bound, dict) or bound.keys() != {*Bound._fields, "passed"}:
        raise BenchmarkError(f"{where}: want {', '.join(Bound._fields)} and passed")
    if bound["sense"] not in (AT_LEAST, AT_MOST):
        raise BenchmarkError(f"{where}: sense = {bound['sense']!r}: want {AT_LEAST} or {AT_MOST}")
    for key in ("value", "bound"):
        if type(bound[key]) not in (int, float) or not math.isfinite(bound[key]):
            raise BenchmarkError(f"{where}: {key} = {bound[key]!r}: want a finite number")
    if Bound(*(bound[key] for key in Bound._fields)).passed is not bound["passed"]:
        raise BenchmarkError(f"{where}: passed = {bound['passed']}: its value says otherwise")
