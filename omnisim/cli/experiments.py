"""`omnisim experiments`."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from rich.console import Console

from omnisim.cli.progress import count_along
from omnisim.experiments.paper import run_experiments
from omnisim.reports.report import HTML, check_report_target


def run(output: Path, device: int | None, out: Console, err: Console) -> bool:
    """Run the experiments, write their report, and return whether every bound holds.

    Raises:
        OmnisimError: anything that the user can put right.
    """
    check_report_target(output)
    start = time.monotonic()
    report = run_experiments(output, device, _progress(err))
    for section in report.sections:
        if section.measures:
            out.print(section.title, style="bold", markup=False)
        for measure in section.measures:
            line = f"  {measure.name}: {measure.value_text} {measure.bound_text}".rstrip()
            line += f" (the paper: {measure.paper})" if measure.paper else ""
            out.print(line, style="red" if measure.passed is False else None, markup=False)
    missed = f"; {len(report.missed)} bounds missed" if report.missed else "; every bound holds"
    seconds = time.monotonic() - start
    out.print(f"{output / HTML}: {seconds:.0f} s{missed}", markup=False)
    return not report.missed


def _progress(err: Console) -> Callable[[str, int], Callable[[Iterable[int]], Iterable[int]]]:
    """Progress bars on a terminal, a line for each part elsewhere."""

    def part(what: str, total: int) -> Callable[[Iterable[int]], Iterable[int]]:
        def along(steps: Iterable[int]) -> Iterator[int]:
            if not err.is_terminal:
                err.print(what, markup=False)
            yield from count_along(steps, what, total, err)

        return along

    return part
