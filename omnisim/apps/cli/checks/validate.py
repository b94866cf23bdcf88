"""`omnisim validate`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection

from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from omnisim.apps.cli.checks.requests import ValidateRequest
from omnisim.apps.cli.console import err, out
from omnisim.core.errors import OmnisimError, did_you_mean
from omnisim.report.machine import machine_of_device
from omnisim.report.report import HTML, Section, check_report_target
from omnisim.validation.check_registry import CHECKS, Check
from omnisim.validation.fixture import Fixture
from omnisim.validation.suite import make_report, run_checks

_COLORS = {"passed": "green", "failed": "bold red", "skipped": "yellow", "measured": "default"}


def run(request: ValidateRequest) -> bool:
    """Run the checks, write the report, and return whether all bounds hold."""
    checks = _select(request.only or (), request.quick)
    check_report_target(request.output)
    machine = machine_of_device(request.device)  # missing OpenGL fails here, before the checks
    sections: list[Section] = []
    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=24),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
    )
    console, is_hidden = err.console, not err.is_terminal
    with Progress(*columns, console=console, transient=True, disable=is_hidden) as progress:
        task = progress.add_task(escape(checks[0].title), total=len(checks))
        for section in run_checks(Fixture(request.device, request.quick), checks):
            sections.append(section)
            _print(section)
            following = checks[len(sections)].title if len(sections) < len(checks) else ""
            progress.update(task, advance=1, description=escape(following))
    report = make_report(sections, request.quick, machine)
    report.write(request.output)
    counts = Counter(section.status for section in sections)
    summary = f"{request.output / HTML}: {counts['passed']} passed"
    summary += f", {counts['failed']} failed" if counts["failed"] else ""
    summary += f", {counts['skipped']} skipped" if counts["skipped"] else ""
    out.print(summary, markup=False)
    return report.passed


def _select(only: Collection[str], is_quick: bool) -> list[Check]:
    known = {check.key: check for check in CHECKS}
    for key in only:
        if key not in known:
            hint = did_you_mean(key, known, "known:")
            raise OmnisimError(f"--only: expected a check, got {key!r}; {hint}")
    if only:
        return [check for check in CHECKS if check.key in only]
    return [check for check in CHECKS if check.is_quick or not is_quick]


def _print(section: Section) -> None:
    color = _COLORS[section.status]
    time = f"{section.seconds:5.1f} s" if section.seconds is not None else ""
    out.print(f"[{color}]{section.status:8}[/] {escape(section.title):55} {time}")
    if section.skipped or section.failure:
        out.print(f"         {escape(section.skipped or section.failure)}")
    for measure in section.missed:
        line = f"{measure.name}: {measure.value_text} {measure.bound_text}"
        out.print(f"         [red]missed[/] {escape(line)}")
