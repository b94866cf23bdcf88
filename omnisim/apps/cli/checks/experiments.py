"""`omnisim experiments`."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator

from omnisim.apps.cli.checks.requests import ExperimentsRequest
from omnisim.apps.cli.console import err, out, track
from omnisim.report.report import HTML, check_report_target
from omnisim.validation.experiments.paper import run_experiments


def run(request: ExperimentsRequest) -> bool:
    """Run the experiments, write their report, and return whether all bounds hold."""
    check_report_target(request.output)
    start = time.monotonic()
    report = run_experiments(request.output, request.device, _progress)
    for section in report.sections:
        if section.measures:
            out.print(section.title, style="bold", markup=False)
        for measure in section.measures:
            line = f"  {measure.name}: {measure.value_text} {measure.bound_text}".rstrip()
            line += f" (the paper: {measure.paper})" if measure.paper else ""
            out.print(line, style="red" if measure.passed is False else None, markup=False)
    missed = f"; {len(report.missed)} bounds missed" if report.missed else "; every bound holds"
    seconds = time.monotonic() - start
    out.print(f"{request.output / HTML}: {seconds:.0f} s{missed}", markup=False)
    return not report.missed


def _progress(description: str, total: int) -> Callable[[Iterable[int]], Iterable[int]]:
    """Show the progress of one part: a bar on a terminal, else a line."""

    def along(steps: Iterable[int]) -> Iterator[int]:
        if not err.is_terminal:
            err.print(description, markup=False)
        yield from track(steps, description, total)

    return along
