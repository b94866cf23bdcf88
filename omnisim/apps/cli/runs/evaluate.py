"""`omnisim evaluate`: errors of estimators in a run, or by a varied value of a plan's drives."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from omnisim.apps.cli.console import out, pluralize, print_note, resumable, table, track
from omnisim.apps.cli.runs.requests import EvaluateRequest
from omnisim.core.errors import OmnisimError, PlanError
from omnisim.core.extras import require_extra
from omnisim.core.files.atomic_file import write_text
from omnisim.datasets.export.recording import Recording
from omnisim.evaluation.drive_sweep import PointResult, run_sweep, run_sweep_on_ray
from omnisim.evaluation.estimator_registry import COMMAND, ESTIMATORS, estimator_named
from omnisim.evaluation.run_evaluation import Outcome, estimator_folder, evaluate_estimator
from omnisim.evaluation.sweep_plan import find_plan, read_plan

OUTCOMES = "outcomes.json"
POINTS, DRIVES = "points.json", "drives"
# Columns of the printed tables; > is that of numbers.
_PRINTED = ("estimator", ">ATE m", ">% of path", ">drift %", ">yaw °", ">lost %", ">aligned", ">s")
_SWEPT = ("value", "estimator", ">% of path", ">drift %", ">lost %", ">without")
_NAME_LETTERS = 24


def run(request: EvaluateRequest) -> bool:
    """Apply estimators to a run or to the drives of a plan, and write a report.

    An estimator that is missing, fails, crashes or hangs is a row of the report. Returns False if
    all of a run's estimators did.
    """
    require_extra("reports", "omnisim evaluate", OmnisimError)
    from omnisim.report.report import check_report_target

    check_report_target(request.output)
    if not request.run.is_dir():
        plan = find_plan(request.run)
        if request.estimators:
            raise PlanError("--with: expected none with a plan, which names its estimators")
        _sweep(request, plan)
        return True
    if request.engine != "local" or request.address is not None:
        raise PlanError("--engine: expected a plan, got a run")
    return any(outcome.status == "ok" for outcome in _evaluate_run(request))


def _evaluate_run(request: EvaluateRequest) -> list[Outcome]:
    from omnisim.report.estimator_report import RUN_COLUMNS, run_row, run_section
    from omnisim.report.report import HTML, Report

    given = request.estimators or list(ESTIMATORS)  # a value lists several, unless it is a command
    lists = ([value] if value.startswith(COMMAND) else value.split(",") for value in given)
    names = list(dict.fromkeys(itertools.chain(*lists)))
    for name in names:
        estimator_named(name)
    recording = Recording.read(request.run)
    outcomes = []
    for name in track(names, "Estimators"):
        folder = request.output / estimator_folder(name)
        outcomes.append(evaluate_estimator(request.run, name, folder, request.limit_s))
    section = run_section(recording, outcomes, request.output)
    title = recording.run.manifest.title
    facts = {"run": request.run.name, "title": title}
    truth = recording.fine_truth
    text = f"{truth.path_length_m:.4g} m in {truth.duration_s:.4g} s."
    Report(f"Estimators: {title}", text, (section,), facts).write(request.output)
    content = [outcome.as_dict() for outcome in outcomes]
    write_text(request.output / OUTCOMES, json.dumps(content, indent=2) + "\n")
    out.print(f"{request.output / HTML}: written")
    rows = [dict(zip(RUN_COLUMNS, run_row(outcome), strict=True)) for outcome in outcomes]
    for row in rows:
        if len(row["estimator"]) > _NAME_LETTERS:
            row["estimator"] = row["estimator"][: _NAME_LETTERS - 1] + "…"
    _print_rows(_PRINTED, rows)
    for outcome in outcomes:
        if outcome.reason:
            print_note(f"{outcome.estimator}: {outcome.status}: {outcome.reason}")
        min_path_m = estimator_named(outcome.estimator).min_path_m
        if outcome.status == "ok" and truth.path_length_m < min_path_m:
            print_note(
                f"{outcome.estimator}: the path is {truth.path_length_m:.3g} m long: its error in "
                f"percent is several times that of paths of more than {min_path_m:g} m"
            )
    return outcomes


def _print_rows(
    headings: Sequence[str], rows: Iterable[Mapping[str, str]], title: str = ""
) -> None:
    """Print some columns of rows as a table; a heading that begins with > is that of numbers."""
    shown = table(*headings)
    shown.title, shown.title_justify = title, "left"
    for row in rows:
        shown.add_row(*(row[heading.removeprefix(">")] for heading in headings))
    out.print(shown)


def _sweep(request: EvaluateRequest, path: Path) -> None:
    from omnisim.report.estimator_report import sweep_sections
    from omnisim.report.report import HTML, Report

    if request.address is not None and request.engine != "ray":
        raise PlanError("--address: requires --engine ray")
    plan, points = read_plan(path)
    place = {(each.variation, each.label, each.seed): k for k, each in enumerate(points)}
    results: list[PointResult] = []
    folder = request.output / DRIVES
    if request.engine == "ray":
        require_extra("ray", "omnisim evaluate --engine ray")
        steps = run_sweep_on_ray(plan, points, folder, request.address)
    else:
        steps = run_sweep(plan, points, folder, request.processes)

    def state() -> str:
        finished = f"{len(results)} of {pluralize(len(points), 'drive')} finished"
        return f"{request.output}: {finished}: run the same command to resume"

    with resumable(state):
        for result in track(steps, "Drives", len(points)):
            results.append(result)  # noqa: PERF402 - `state` counts them
    results.sort(key=lambda each: place[each.point.variation, each.point.label, each.point.seed])
    sections = sweep_sections(plan, results)
    text = (
        f"{plan.robot} in {plan.scene} along {plan.path}: "
        f"{pluralize(len(plan.seeds), 'seed')} for each value."
    )
    facts = {"plan": path.name, "seeds": list(plan.seeds)}
    title = plan.title or "Estimators on varied drives"
    Report(title, text, sections, facts).write(request.output)
    content = [
        {
            "drive": result.point.drive.name,
            "variation": result.point.variation,
            "value": result.point.label,
            "seed": result.point.seed,
            "outcomes": [outcome.as_dict() for outcome in result.outcomes],
        }
        for result in results
    ]
    write_text(request.output / POINTS, json.dumps(content, indent=2) + "\n")
    out.print(f"{request.output / HTML}: written")
    for section in sections:
        swept = section.tables[0]
        rows = (dict(zip(swept.columns, row, strict=True)) for row in swept.rows)
        _print_rows(_SWEPT, rows, section.title)
    reasons = (outcome.reason for result in results for outcome in result.outcomes)
    for reason in filter(None, dict.fromkeys(reasons)):
        print_note(reason)
