"""`omnisim evaluate` on a run: errors of estimators against the recorded truth."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from omnisim.apps.cli.console import out, print_note, track
from omnisim.apps.cli.runs.evaluate_sweep import sweep
from omnisim.apps.cli.runs.requests import EvaluateRequest
from omnisim.core.errors import OmnisimError
from omnisim.core.extras import require_extra
from omnisim.core.files.atomic_file import write_text
from omnisim.core.trajectories import Trajectory, read_trajectory
from omnisim.core.trajectories.trajectory import step_lengths_m
from omnisim.datasets.export.recording import Recording
from omnisim.evaluation.camera_errors import CameraErrors
from omnisim.evaluation.estimator_registry import ESTIMATORS, estimator_named
from omnisim.evaluation.estimator_worker import ESTIMATE
from omnisim.evaluation.outcome import Outcome
from omnisim.evaluation.run_evaluation import estimator_folder, evaluate_estimator
from omnisim.evaluation.trajectory_errors import match_times

if TYPE_CHECKING:
    from omnisim.validation.report.report import Section

Floats = NDArray[np.float64]
OUTCOMES = "outcomes.json"
_COLUMNS = (
    "estimator", "ATE m", "% of path", "RPE mm", "RPE °", "drift %", "yaw °", "gravity °", "scale",
    "lost %", "aligned", "s",
)  # fmt: skip
_CAMERA_COLUMNS = ("estimator", "model", "focal length %", "RMS px", "max px", "of the image %")
_PRINTED = ("estimator", "ATE m", "% of path", "drift %", "yaw °", "lost %", "aligned", "s")
_NAME_LETTERS = 24


def run(request: EvaluateRequest) -> None:
    """Apply estimators to a run or to the drives of a plan, and write a report.

    An estimator that is missing, fails, crashes or hangs is a row of the report.

    Raises:
        EstimatorError: an unknown estimator.
        PlanError: a fault in the plan.
        RunError: the run is not finished, or damaged.
        OutputError: the report cannot be written.
    """
    require_extra("reports", "omnisim evaluate", OmnisimError)
    from omnisim.validation.report.report import Report, check_report_target

    check_report_target(request.output)
    if request.run.suffix == ".toml":
        sweep(request)
        return
    names = list(dict.fromkeys(request.estimators or ESTIMATORS))
    for name in names:
        estimator_named(name)
    recording = Recording.read(request.run)
    outcomes = []
    for number in track(range(len(names)), "Estimators", len(names)):
        name = names[number]
        folder = request.output / estimator_folder(name)
        outcomes.append(evaluate_estimator(request.run, name, folder, request.limit_s))
    section = _section(recording, outcomes, request.output)
    title = recording.run.manifest.title
    facts = {"run": request.run.name, "title": title}
    Report(f"Estimators: {title}", _text(recording), (section,), facts).write(request.output)
    content = [one.as_dict() for one in outcomes]
    write_text(request.output / OUTCOMES, json.dumps(content, indent=2) + "\n")
    _print(request.output, outcomes)


def _text(recording: Recording) -> str:
    truth = recording.fine_truth
    return f"{truth.path_length_m:.4g} m in {truth.duration_s:.4g} s."


def _row(outcome: Outcome) -> tuple[str, ...]:
    """Cells of an outcome, by `_COLUMNS`."""
    seconds = "" if outcome.seconds is None else f"{outcome.seconds:.1f}"
    errors = outcome.errors
    if errors is None:
        return outcome.estimator, outcome.status, *("",) * (len(_COLUMNS) - 3), seconds
    share = 100.0 * errors.ate_m / errors.way_m if errors.way_m > 0.0 else math.nan
    return (
        outcome.estimator,
        f"{errors.ate_m:.4f}",
        f"{share:.3f}",
        f"{1e3 * errors.rpe_m:.2f}",
        f"{errors.rpe_deg:.3f}",
        f"{100.0 * errors.drift:.2f}",
        f"{errors.yaw_deg:.2f}",
        f"{errors.gravity_deg:.2f}" if estimator_named(outcome.estimator).is_level else "",
        f"{errors.scale:.4f}",
        f"{100.0 * errors.lost:.1f}",
        errors.kind,
        seconds,
    )


def _camera_row(estimator: str, errors: CameraErrors) -> tuple[str, ...]:
    """Cells of a calibrated camera, by `_CAMERA_COLUMNS`."""
    return (
        estimator,
        errors.model,
        f"{100.0 * errors.focal_length:+.3f}",
        f"{errors.rms_px:.3f}",
        f"{errors.max_px:.3g}",
        f"{100.0 * errors.covered:.4g}",
    )


def _section(recording: Recording, outcomes: Sequence[Outcome], folder: Path) -> Section:
    from omnisim.validation.plots.estimator_plots import offsets_figure, trajectories_figure
    from omnisim.validation.report.report import CaptionedFigure, ResultTable, Section

    truth = recording.fine_truth
    aligned = _aligned(outcomes, folder)
    offsets = {name: _offsets(trajectory, truth) for name, trajectory in aligned.items()}
    failures = tuple(
        (one.estimator, one.status, one.reason) for one in outcomes if one.status != "ok"
    )
    rows = tuple(_row(one) for one in outcomes if one.camera is None)
    tables = [ResultTable("Errors of the trajectories.", _COLUMNS, rows)]
    if cameras := tuple(_camera_row(one.estimator, one.camera) for one in outcomes if one.camera):
        tables.append(ResultTable("Errors of the calibrated cameras.", _CAMERA_COLUMNS, cameras))
    if failures:
        columns = ("estimator", "status", "reason")
        tables.append(ResultTable("Estimators without a trajectory.", columns, failures))
    positions = {name: one.positions_m for name, one in aligned.items()}
    return Section(
        "Estimators",
        "ATE: root mean square distance from the truth after alignment (se3: by rotation and "
        "translation; sim3: by scale, too; none: the estimator starts at the true pose). RPE: "
        "error of the motion between successive poses. Drift: error of the motion over a tenth of "
        "the path, as a share of its length. Lost: share of the time before the first and after "
        "the last pose.",
        tables=tables,
        figures=[
            CaptionedFigure(
                "trajectories",
                trajectories_figure(truth.positions_m, positions),
                "Aligned trajectories and the truth, from above",
            ),
            CaptionedFigure(
                "offsets",
                offsets_figure(offsets),
                "Distance from the truth over the distance traveled",
            ),
        ],
    )


def _aligned(outcomes: Sequence[Outcome], folder: Path) -> Mapping[str, Trajectory]:
    """Aligned trajectories by estimator, without the estimators that failed."""
    aligned = {}
    for outcome in outcomes:
        if outcome.errors is not None:
            path = folder / estimator_folder(outcome.estimator) / ESTIMATE
            estimate = read_trajectory(path)
            poses = outcome.errors.alignment.apply(estimate.world_from_base)
            aligned[outcome.estimator] = Trajectory(estimate.times_s, poses)
    return aligned


def _offsets(
    estimate: Trajectory, truth: Trajectory
) -> tuple[
    np.ndarray[tuple[int], np.dtype[np.float64]], np.ndarray[tuple[int], np.dtype[np.float64]]
]:
    """Distances (n,) traveled and distances (n,) from the truth, in meters."""
    used, nearest = match_times(estimate.times_s, truth.times_s)
    way = np.concatenate(([0.0], np.cumsum(step_lengths_m(truth.world_from_base))))
    offsets = estimate.positions_m[used] - truth.positions_m[nearest]
    return way[nearest], np.linalg.norm(offsets, axis=1)


def _print(folder: Path, outcomes: Sequence[Outcome]) -> None:
    table = Table(box=None, pad_edge=False)
    for heading in _PRINTED:
        table.add_column(heading, justify="left" if heading == "estimator" else "right")
    for outcome in outcomes:
        cells = dict(zip(_COLUMNS, _row(outcome), strict=True))
        name = cells["estimator"]
        cells["estimator"] = name if len(name) <= _NAME_LETTERS else name[: _NAME_LETTERS - 1] + "…"
        table.add_row(*(cells[heading] for heading in _PRINTED))
    out.print(f"{folder}: written", markup=False)
    out.print(table)
    for outcome in outcomes:
        if outcome.reason:
            print_note(f"{outcome.estimator}: {outcome.status}: {outcome.reason}")
