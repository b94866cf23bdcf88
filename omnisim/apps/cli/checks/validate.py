"""`omnisim validate` and `omnisim experiments`."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator

from rich.markup import escape

from omnisim.apps.cli.checks.requests import ExperimentsRequest, ValidateRequest
from omnisim.apps.cli.console import err, out, progress, track
from omnisim.core.errors import OmnisimError, did_you_mean
from omnisim.report.machine import machine_of_device
from omnisim.report.report import HTML, Section, check_report_target
from omnisim.validation.check_registry import CHECKS, make_report, run_checks
from omnisim.validation.experiments.paper import run_experiments
from omnisim.validation.fixture import Fixture

_COLORS = {"passed": "green", "failed": "bold red", "skipped": "yellow", "measured": "default"}


def run(request: ValidateRequest) -> bool:
    """Run the checks, write the report, and return whether all bounds hold."""
    known, only = {check.key: check for check in CHECKS}, request.only or ()
    for key in only:
        if key not in known:
            hint = did_you_mean(key, known, "known:")
            raise OmnisimError(f"--only: expected a check, got {key!r}; {hint}")
    quick = [check for check in CHECKS if check.is_quick or not request.quick]
    checks = [known[key] for key in known if key in only] if only else quick
    check_report_target(request.output)
    machine = machine_of_device(request.device)  # missing OpenGL fails here, before the checks
    sections: list[Section] = []
    with progress(checks[0].title, len(checks)) as show:
        for section in run_checks(Fixture(request.device, request.quick), checks):
            sections.append(section)
            color = _COLORS[section.status]
            seconds = f"{section.seconds:5.1f} s" if section.seconds is not None else ""
            title = f"{escape(section.title):55} {seconds}"
            out.print(f"[{color}]{section.status:8}[/] {title}", markup=True)
            if section.skipped or section.failure:
                out.print(f"         {section.skipped or section.failure}")
            for measure in section.missed:
                line = f"{measure.name}: {measure.value_text} {measure.bound_text}"
                out.print(f"         [red]missed[/] {escape(line)}", markup=True)
            following = checks[len(sections)].title if len(sections) < len(checks) else ""
            show(len(sections), following)
    report = make_report(sections, request.quick, machine)
    report.write(request.output)
    counts = Counter(section.status for section in sections)
    summary = f"{request.output / HTML}: {counts['passed']} passed"
    for status in ("failed", "skipped"):
        summary += f", {counts[status]} {status}" if counts[status] else ""
    out.print(summary)
    return report.passed


def experiments(request: ExperimentsRequest) -> bool:
    """Run the experiments, write their report, and return whether all bounds hold."""
    check_report_target(request.output)
    start = time.monotonic()
    report = run_experiments(request.output, request.device, _progress)
    for section in report.sections:
        if section.measures:
            out.print(section.title, style="bold")
        for measure in section.measures:
            line = f"  {measure.name}: {measure.value_text} {measure.bound_text}".rstrip()
            line += f" (the paper: {measure.paper})" if measure.paper else ""
            out.print(line, style="red" if measure.passed is False else None)
    missed = f"; {len(report.missed)} bounds missed" if report.missed else "; every bound holds"
    seconds = time.monotonic() - start
    out.print(f"{request.output / HTML}: {seconds:.0f} s{missed}")
    return not report.missed


def _progress(description: str, total: int) -> Callable[[Iterable[int]], Iterable[int]]:
    """Show the progress of one part: a bar on a terminal, else a line."""

    def along(steps: Iterable[int]) -> Iterator[int]:
        if not err.is_terminal:
            err.print(description)
        yield from track(steps, description, total)

    return along
