"""`omnisim evaluate` on a run: errors of estimators against the recorded truth."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path

from rich.table import Table

from omnisim.apps.cli.console import out, print_note, track
from omnisim.apps.cli.runs.evaluate_sweep import sweep
from omnisim.apps.cli.runs.requests import EvaluateRequest
from omnisim.core.errors import OmnisimError, PlanError
from omnisim.core.extras import require_extra
from omnisim.core.files.atomic_file import write_text
from omnisim.datasets.export.recording import Recording
from omnisim.evaluation.estimator_registry import COMMAND, ESTIMATORS, estimator_named
from omnisim.evaluation.run_evaluation import Outcome, estimator_folder, evaluate_estimator
from omnisim.evaluation.sweep_plan import find_plan

OUTCOMES = "outcomes.json"
_PRINTED = ("estimator", "ATE m", "% of path", "drift %", "yaw °", "lost %", "aligned", "s")
_NAME_LETTERS = 24


def run(request: EvaluateRequest) -> bool:
    """Apply estimators to a run or to the drives of a plan, and write a report.

    An estimator that is missing, fails, crashes or hangs is a row of the report. Returns False if
    all of a run's estimators did.

    Raises:
        EstimatorError: an unknown estimator.
        PlanError: a fault in the plan.
        RunError: the run is not finished, or damaged.
        OutputError: the report cannot be written.
    """
    require_extra("reports", "omnisim evaluate", OmnisimError)
    from omnisim.report.report import check_report_target

    check_report_target(request.output)
    if not request.run.is_dir():
        plan = find_plan(request.run)
        if request.estimators:
            raise PlanError("--with: a plan names its estimators")
        sweep(request, plan)
        return True
    if request.engine != "local" or request.address is not None:
        raise PlanError("--engine: expected a plan, got a run")
    return any(outcome.status == "ok" for outcome in _evaluate_run(request))


def _names(given: Iterable[str]) -> list[str]:
    """Names of estimators, each once; a value lists several, unless it is a command."""
    names = []
    for value in given:
        names += [value] if value.startswith(COMMAND) else value.split(",")
    return list(dict.fromkeys(names))


def _evaluate_run(request: EvaluateRequest) -> list[Outcome]:
    from omnisim.report.estimator_report import run_section
    from omnisim.report.report import Report

    names = _names(request.estimators or ESTIMATORS)
    for name in names:
        estimator_named(name)
    recording = Recording.read(request.run)
    outcomes = []
    for number in track(range(len(names)), "Estimators", len(names)):
        name = names[number]
        folder = request.output / estimator_folder(name)
        outcomes.append(evaluate_estimator(request.run, name, folder, request.limit_s))
    section = run_section(recording, outcomes, request.output)
    title = recording.run.manifest.title
    facts = {"run": request.run.name, "title": title}
    Report(f"Estimators: {title}", _text(recording), (section,), facts).write(request.output)
    content = [one.as_dict() for one in outcomes]
    write_text(request.output / OUTCOMES, json.dumps(content, indent=2) + "\n")
    _print(request.output, outcomes)
    return outcomes


def _text(recording: Recording) -> str:
    truth = recording.fine_truth
    return f"{truth.path_length_m:.4g} m in {truth.duration_s:.4g} s."


def _print(folder: Path, outcomes: Sequence[Outcome]) -> None:
    from omnisim.report.estimator_report import RUN_COLUMNS, run_row

    table = Table(box=None, pad_edge=False)
    for heading in _PRINTED:
        table.add_column(heading, justify="left" if heading == "estimator" else "right")
    for outcome in outcomes:
        cells = dict(zip(RUN_COLUMNS, run_row(outcome), strict=True))
        name = cells["estimator"]
        cells["estimator"] = name if len(name) <= _NAME_LETTERS else name[: _NAME_LETTERS - 1] + "…"
        table.add_row(*(cells[heading] for heading in _PRINTED))
    out.print(f"{folder}: written", markup=False)
    out.print(table)
    for outcome in outcomes:
        if outcome.reason:
            print_note(f"{outcome.estimator}: {outcome.status}: {outcome.reason}")
