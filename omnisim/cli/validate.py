"""`omnisim validate`."""

from __future__ import annotations

import difflib
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from omnisim.errors import OmnisimError
from omnisim.validation.chapters import CHAPTERS, Chapter, Outcome, run_chapters
from omnisim.validation.check import Bench
from omnisim.validation.report import Report, check_report_target, machine

_COLORS = {"passed": "green", "failed": "bold red", "skipped": "yellow"}


def run(
    output: Path, is_quick: bool, only: list[str], device: int | None, out: Console, err: Console
) -> bool:
    """Run the checks, write the report, and return whether every bound holds.

    Raises:
        OmnisimError: anything that the user can put right.
    """
    chapters = _chosen(only, is_quick)
    check_report_target(output)
    machine_here = machine(device)  # without OpenGL better now than after the work
    bench = Bench(device=device, is_quick=is_quick)
    outcomes: list[Outcome] = []
    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=24),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=err, transient=True, disable=not err.is_terminal) as progress:
        task = progress.add_task(escape(chapters[0].title), total=len(chapters))
        for outcome in run_chapters(bench, chapters):
            outcomes.append(outcome)
            _print(outcome, out)
            following = chapters[len(outcomes)].title if len(outcomes) < len(chapters) else ""
            progress.update(task, advance=1, description=escape(following))
    report = Report(outcomes, is_quick, machine_here)
    report.write(output)
    skipped = sum(outcome.status == "skipped" for outcome in outcomes)
    failed = sum(outcome.status == "failed" for outcome in outcomes)
    told = f"{output / 'report.html'}: {len(outcomes) - skipped - failed} passed"
    told += f", {failed} failed" if failed else ""
    told += f", {skipped} skipped" if skipped else ""
    out.print(told, markup=False)
    return report.passed


def _chosen(only: list[str], is_quick: bool) -> list[Chapter]:
    known = {chapter.key: chapter for chapter in CHAPTERS}
    for key in only:
        if key not in known:
            near = difflib.get_close_matches(key, known, n=1)
            hint = f"did you mean {near[0]!r}?" if near else "known: " + ", ".join(known)
            raise OmnisimError(f"--only {key}: no such check; {hint}")
    if only:
        return [chapter for chapter in CHAPTERS if chapter.key in only]
    return [chapter for chapter in CHAPTERS if chapter.is_quick or not is_quick]


def _print(outcome: Outcome, out: Console) -> None:
    color = _COLORS[outcome.status]
    time = f"{outcome.seconds:5.1f} s" if outcome.findings else ""
    out.print(f"[{color}]{outcome.status:8}[/] {escape(outcome.chapter.title):55} {time}")
    if outcome.reason:
        out.print(f"         {escape(outcome.reason)}")
    for measure in outcome.findings.measures if outcome.findings else ():
        sign = "≥" if measure.at_least else "≤"
        line = f"{measure.name}: {measure.value:.3g} {sign} {measure.bound:.3g} {measure.unit}"
        if not measure.passed:
            out.print(f"         [red]missed[/] {escape(line)}")
