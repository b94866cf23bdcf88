"""`omnisim evaluate` on a plan: errors of estimators by varied value."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from rich.table import Table

from omnisim.apps.cli.console import err, out, pluralize, print_note, track
from omnisim.apps.cli.runs.requests import EvaluateRequest
from omnisim.core.errors import PlanError, did_you_mean
from omnisim.core.extras import require_extra
from omnisim.core.files.atomic_file import write_text
from omnisim.evaluation.drive_sweep import PointResult, run_sweep
from omnisim.evaluation.sweep_plan import SweepPlan, SweepPoint, read_plan

if TYPE_CHECKING:
    from omnisim.report.report import Section

POINTS, DRIVES = "points.json", "drives"
ENGINES = ("local", "ray")
_PRINTED = ("value", "estimator", "% of path", "drift %", "lost %", "without")


def sweep(request: EvaluateRequest, path: Path) -> None:
    """Record the drives of a plan, apply the estimators, and write a report.

    Raises:
        PlanError: a fault in the plan.
        OutputError: a file cannot be written.
    """
    from omnisim.report.estimator_report import sweep_sections
    from omnisim.report.report import Report

    if request.engine not in ENGINES:
        raise PlanError(f"--engine {request.engine!r}: {did_you_mean(request.engine, ENGINES)}")
    if request.address is not None and request.engine != "ray":
        raise PlanError("--address: requires --engine ray")
    plan, points = read_plan(path)
    results = finished_points(request, plan, points)
    sections = sweep_sections(plan, results)
    text = (
        f"{plan.robot} in {plan.scene} along {plan.path}: "
        f"{pluralize(len(plan.seeds), 'seed')} for each value."
    )
    facts = {"plan": path.name, "seeds": list(plan.seeds)}
    title = plan.title or "Estimators on varied drives"
    Report(title, text, sections, facts).write(request.output)
    write_text(request.output / POINTS, points_json(results))
    out.print(f"{request.output}: written", markup=False)
    for section in sections:
        _print(section)
    for reason in dict.fromkeys(each.reason for one in results for each in one.outcomes):
        if reason:
            print_note(reason)


def finished_points(
    request: EvaluateRequest, plan: SweepPlan, points: list[SweepPoint]
) -> list[PointResult]:
    """Results of all points, in the plan's order, with a bar of progress."""
    place = {_key(point): index for index, point in enumerate(points)}
    results = []
    steps = _steps(request, plan, points)
    try:
        for _ in track(range(len(points)), "Drives", len(points)):
            results.append(next(steps))
    except KeyboardInterrupt:
        count = pluralize(len(points), "drive")
        text = f"{request.output}: {len(results)} of {count} finished: the same command resumes"
        err.print(text, markup=False)
        raise
    return sorted(results, key=lambda one: place[_key(one.point)])


def _steps(
    request: EvaluateRequest, plan: SweepPlan, points: list[SweepPoint]
) -> Iterator[PointResult]:
    folder = request.output / DRIVES
    if request.engine == "ray":
        require_extra("ray", "omnisim evaluate --engine ray")
        from omnisim.evaluation.ray_sweep import run_sweep_on_ray

        return run_sweep_on_ray(plan, points, folder, request.address)
    return run_sweep(plan, points, folder, request.processes)


def _key(point: SweepPoint) -> tuple[int | None, str, int]:
    return point.variation, point.label, point.seed


def points_json(results: list[PointResult]) -> str:
    """Results as JSON text."""
    content = [
        {
            "drive": one.point.drive.name,
            "variation": one.point.variation,
            "value": one.point.label,
            "seed": one.point.seed,
            "outcomes": [each.as_dict() for each in one.outcomes],
        }
        for one in results
    ]
    return json.dumps(content, indent=2) + "\n"


def _print(section: Section) -> None:
    table = Table(box=None, pad_edge=False, title=section.title, title_justify="left")
    for heading in _PRINTED:
        table.add_column(heading, justify="left" if heading in ("value", "estimator") else "right")
    columns = section.tables[0].columns
    for row in section.tables[0].rows:
        cells = dict(zip(columns, row, strict=True))
        table.add_row(*(cells[heading] for heading in _PRINTED))
    out.print(table)
