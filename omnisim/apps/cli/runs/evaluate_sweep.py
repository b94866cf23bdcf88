"""`omnisim evaluate` on a plan: errors of estimators by varied value."""

from __future__ import annotations

import json
import math
import statistics
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from rich.table import Table

from omnisim.apps.cli.console import out, pluralize, print_note, track
from omnisim.apps.cli.runs.requests import EvaluateRequest
from omnisim.core.files.atomic_file import write_text
from omnisim.evaluation.drive_sweep import PointResult, run_sweep
from omnisim.evaluation.outcome import Outcome
from omnisim.evaluation.sweep_plan import BASE, SweepPlan, read_plan

if TYPE_CHECKING:
    from omnisim.validation.report.report import Section

POINTS = "points.json"
_COLUMNS = ("value", "estimator", "ATE % of path", "±", "drift %", "lost %", "s", "without")
_PRINTED = ("value", "estimator", "ATE % of path", "±", "drift %", "without")


def sweep(request: EvaluateRequest) -> None:
    """Record the drives of a plan, apply the estimators, and write a report.

    Raises:
        PlanError: a fault in the plan.
        OutputError: a file cannot be written.
    """
    from omnisim.validation.report.report import Report

    plan, points = read_plan(request.run)
    base = request.run.absolute().parent
    results = run_sweep(plan, points, base, request.output / "drives", request.processes)
    done = [next(results) for _ in track(range(len(points)), "Drives", len(points))]
    sections = [_section(plan, done, index) for index in range(len(plan.vary))]
    if not sections:
        sections = [_section(plan, done, None)]
    text = (
        f"{plan.robot} in {plan.scene} along {plan.path}: "
        f"{pluralize(len(plan.seeds), 'seed')} for each value."
    )
    facts = {"plan": request.run.name, "seeds": list(plan.seeds)}
    Report("Estimators on varied drives", text, sections, facts).write(request.output)
    content = [
        {"drive": one.point.name, "outcomes": [each.as_dict() for each in one.outcomes]}
        for one in done
    ]
    write_text(request.output / POINTS, json.dumps(content, indent=2) + "\n")
    out.print(f"{request.output}: written", markup=False)
    for section in sections:
        _print(section)
    for reason in dict.fromkeys(each.reason for one in done for each in one.outcomes):
        if reason:
            print_note(reason)


def _values(results: Sequence[PointResult], variation: int | None) -> Iterator[str]:
    """Labels of the base and of a variation's values, in order."""
    shown = [one.point for one in results if one.point.variation in (None, variation)]
    yield from dict.fromkeys(one.label for one in shown)


def _outcomes(
    results: Sequence[PointResult], variation: int | None, label: str, estimator: str
) -> list[Outcome]:
    """Outcomes of an estimator over the seeds of a value."""
    wanted = None if label == BASE else variation
    return [
        outcome
        for result in results
        if result.point.variation == wanted and result.point.label == label
        for outcome in result.outcomes
        if outcome.estimator == estimator
    ]


def _shares(outcomes: Sequence[Outcome]) -> list[float]:
    """Absolute trajectory errors, in percent of the path length."""
    found = [one.errors for one in outcomes if one.errors is not None and one.errors.way_m > 0.0]
    return [100.0 * one.ate_m / one.way_m for one in found]


def _mean(values: Sequence[float]) -> float:
    return statistics.fmean(values) if values else math.nan


def _spread(values: Sequence[float]) -> float:
    """Standard deviation over the seeds; NaN: fewer than two."""
    return statistics.stdev(values) if len(values) > 1 else math.nan


def _row(label: str, estimator: str, outcomes: Sequence[Outcome]) -> tuple[str, ...]:
    """Cells by `_COLUMNS`."""
    shares = _shares(outcomes)
    errors = [one.errors for one in outcomes if one.errors is not None]
    failed = [one for one in outcomes if one.errors is None]
    numbers = (
        _mean(shares),
        _spread(shares),
        100.0 * _mean([one.drift for one in errors]),
        100.0 * _mean([one.lost for one in errors]),
        _mean([one.seconds for one in outcomes if one.seconds is not None]),
    )
    cells = [f"{value:.3g}" if math.isfinite(value) else "" for value in numbers]
    without = f"{len(failed)} of {len(outcomes)} {failed[0].status}" if failed else ""
    return label, estimator, *cells, without


def _section(plan: SweepPlan, results: Sequence[PointResult], variation: int | None) -> Section:
    from omnisim.validation.plots.estimator_plots import SweepLine, sweep_figure
    from omnisim.validation.report.report import CaptionedFigure, ResultTable, Section

    labels = list(_values(results, variation))
    rows, lines = [], []
    for estimator in plan.estimators:
        shares = [_shares(_outcomes(results, variation, label, estimator)) for label in labels]
        means = [_mean(one) for one in shares]
        lines.append(SweepLine(estimator, means, [_spread(one) for one in shares]))
    for label in labels:
        for estimator in plan.estimators:
            outcomes = _outcomes(results, variation, label, estimator)
            rows.append(_row(label, estimator, outcomes))
    varied = None if variation is None else plan.vary[variation]
    title = "The robot as it is" if varied is None else varied.title or varied.key
    tables = [
        ResultTable(
            "Absolute trajectory error with its standard deviation over the seeds, drift over a "
            "tenth of the path, share of lost time, and time taken.",
            _COLUMNS,
            tuple(rows),
        )
    ]
    reasons = {
        (one.estimator, one.status, one.reason)
        for result in results
        for one in result.outcomes
        if one.reason and result.point.variation in (None, variation)
    }
    if reasons:
        columns = ("estimator", "status", "reason")
        tables.append(ResultTable("Reasons of failures.", columns, tuple(sorted(reasons))))
    figures = []
    if varied is not None:
        figure = sweep_figure(title, labels, lines)
        caption = "Absolute trajectory error by the varied value, with its spread over the seeds"
        figures.append(CaptionedFigure(f"sweep-{variation}", figure, caption))
    return Section(title, tables=tables, figures=figures, key=f"sweep-{variation}")


def _print(section: Section) -> None:
    table = Table(box=None, pad_edge=False, title=section.title, title_justify="left")
    for heading in _PRINTED:
        table.add_column(heading, justify="left" if heading in ("value", "estimator") else "right")
    for row in section.tables[0].rows:
        cells = dict(zip(_COLUMNS, row, strict=True))
        table.add_row(*(cells[heading] for heading in _PRINTED))
    out.print(table)
