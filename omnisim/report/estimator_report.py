"""Report sections on estimators: on one run, and on a sweep."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from omnisim.core.errors import OmnisimError
from omnisim.core.poses import inverse
from omnisim.core.trajectories import read_trajectory
from omnisim.core.trajectories.trajectory import step_lengths_m
from omnisim.datasets.export.recording import Recording
from omnisim.evaluation.drive_sweep import PointResult
from omnisim.evaluation.estimator_registry import estimator_named
from omnisim.evaluation.estimator_worker import ESTIMATE
from omnisim.evaluation.run_evaluation import Outcome, estimator_folder, true_trajectory
from omnisim.evaluation.sweep_plan import BASE, SweepPlan, shown_points
from omnisim.evaluation.trajectory_errors import (
    TrajectoryErrors,
    lost_intervals,
    match_times,
    over_seeds,
)
from omnisim.plots import estimator_plots as plots
from omnisim.report.report import CaptionedFigure, ResultTable, Section

METHOD = (
    "ATE: root mean square distance from the truth after alignment (se3: by rotation and "
    "translation; sim3: by scale, too; none: the estimator starts at the true pose). RPE: error of "
    "the motion between successive poses. Drift: error of the motion over a tenth of the path, as "
    "a share of its length. Yaw: error of the aligned headings. Gravity: error of the direction of "
    "gravity, for methods that estimate it. Scale: factor from the estimate's lengths to the true "
    "ones. Lost: share of the time without a pose: before the first one, after the last one, and "
    "in gaps."
)
MIN_LOST = 0.01  # shortest drawn interval without an estimate, as a share of the drive's time
MIN_LOST_PERCENT = 10.0  # of a plot of lost tracking; the first and last moments are always lost
MAX_NAME = 28  # characters of an estimator's name in tables and legends
Measure = Callable[[TrajectoryErrors], float]


def ate_percent(errors: TrajectoryErrors) -> float:
    """Absolute trajectory error, percent of the path length; NaN: no motion."""
    return 100.0 * errors.ate_m / errors.path_length_m if errors.path_length_m > 0.0 else math.nan


def lost_percent(errors: TrajectoryErrors) -> float:
    """Share of the time without an estimate, percent."""
    return 100.0 * errors.lost


_MEASURES: dict[str, tuple[Measure, str]] = {
    "ATE m": (lambda errors: errors.ate_m, ".4f"),
    "% of path": (ate_percent, ".3f"),
    "RPE mm": (lambda errors: 1e3 * errors.rpe_m, ".2f"),
    "RPE °": (lambda errors: errors.rpe_deg, ".3f"),
    "drift %": (lambda errors: 100.0 * errors.drift, ".2f"),
    "yaw °": (lambda errors: errors.yaw_deg, ".2f"),
    "gravity °": (lambda errors: errors.gravity_deg, ".2f"),
    "scale": (lambda errors: errors.scale, ".4f"),
    "lost %": (lost_percent, ".1f"),
}
RUN_COLUMNS = ("estimator", *_MEASURES, "aligned", "s")
CAMERA_COLUMNS = ("estimator", "model", "focal length %", "RMS px", "max px", "% of image")
SWEEP_COLUMNS = ("value", "estimator", *_MEASURES, "aligned", "s", "without")


def run_row(outcome: Outcome) -> tuple[str, ...]:
    """Cells of an outcome, in the order of `RUN_COLUMNS`."""
    seconds = "" if outcome.seconds is None else f"{outcome.seconds:.1f}"
    if outcome.errors is None:
        return outcome.estimator, outcome.status, *("",) * (len(RUN_COLUMNS) - 3), seconds
    return outcome.estimator, *_cells([outcome]), outcome.errors.kind, seconds


def _cells(outcomes: Sequence[Outcome]) -> list[str]:
    """Means of all measures over outcomes of one estimator, with confidence intervals."""
    all_errors = [outcome.errors for outcome in outcomes if outcome.errors is not None]
    cells = []
    for heading, (measure, form) in _MEASURES.items():
        is_known = heading != "gravity °" or estimator_named(outcomes[0].estimator).is_level
        mean = over_seeds([measure(errors) for errors in all_errors] if is_known else [])
        text = format(mean.mean, f"z{form}") if math.isfinite(mean.mean) else ""
        if math.isfinite(mean.mean) and math.isfinite(mean.half_width):
            text += f" ± {mean.half_width:.2g}"
        cells.append(text)
    return cells


def run_section(recording: Recording, outcomes: Sequence[Outcome], folder: Path) -> Section:
    """Section on the estimators of one run.

    Args:
        recording: run with the true poses.
        folder: folder with a subfolder for each estimator's trajectory.
    """
    panel = _track_panel("Trajectories from above", recording, outcomes, folder)
    tracked = [outcome for outcome in outcomes if outcome.camera is None]
    rows = tuple(run_row(outcome) for outcome in tracked)
    tables = [ResultTable("Errors of the trajectories.", RUN_COLUMNS, rows)]
    cameras = tuple(
        (
            outcome.estimator,
            camera.model,
            f"{100.0 * camera.focal_length:+z.3f}",
            f"{camera.rms_px:.3f}",
            f"{camera.max_px:.3g}",
            f"{100.0 * camera.covered:.4g}",
        )
        for outcome in outcomes
        if (camera := outcome.camera)
    )
    if cameras:
        tables.append(ResultTable("Errors of the calibrated cameras.", CAMERA_COLUMNS, cameras))
    tables += _failures(outcomes)
    lost = [_lost_row(_short(each.estimator), each, recording, folder) for each in tracked]
    figures = [
        CaptionedFigure("trajectories", plots.trajectories_figure([panel]),
                        "Aligned trajectories and the truth, from above"),
        CaptionedFigure("offsets", plots.offsets_figure(panel),
                        "Distance from the truth over the distance traveled"),
        CaptionedFigure("lost", plots.lost_figure(lost), "Times without an estimate"),
    ]  # fmt: skip
    return Section("Estimators", METHOD, tables=tables, figures=figures)


def sweep_sections(
    plan: SweepPlan, results: Sequence[PointResult], key: str = "", title: str = ""
) -> list[Section]:
    """Sections on a sweep: one on the unchanged drive, and one on each variation.

    Args:
        results: results of all points.
        key: prefix of the figures' names.
        title: prefix of the sections' titles.
    """
    indices: list[int | None] = [None, *range(len(plan.vary))]
    sections = []
    for index in indices:
        section = _sweep_section(plan, results, index, key)
        if title:
            name = section.title
            name = name[0].lower() + name[1:] if name[:2].istitle() else name  # but IMU
            section = replace(section, title=f"{title}: {name}")
        sections.append(section)
    return sections


def _varied_title(plan: SweepPlan, variation: int | None) -> str:
    """Title of a variation by its index; None: the unchanged drive."""
    if variation is None:
        return "The drive without variation"
    varied = plan.vary[variation]
    return varied.title or ", ".join(varied.keys)


def _value_results(
    results: Sequence[PointResult], variation: int | None
) -> list[tuple[str, list[PointResult]]]:
    """Label and results, one per seed, of each value of a variation."""
    by_point = {id(result.point): result for result in results}
    shown = shown_points([result.point for result in results], variation)
    return [(label, [by_point[id(point)] for point in points]) for label, points in shown]


def _error_lines(
    plan: SweepPlan, values: Sequence[tuple[str, list[PointResult]]], measure: Measure = ate_percent
) -> list[plots.SweepLine]:
    """Line of each estimator: a measure over a variation's values."""
    lines = []
    for estimator in plan.estimators:
        outcomes = [_outcomes_of(group, estimator) for _, group in values]
        seeds = [
            [measure(outcome.errors) for outcome in group if outcome.errors is not None]
            for group in outcomes
        ]
        lines.append(_line(estimator, seeds))
    return lines


def _line(estimator: str, seeds: list[list[float]]) -> plots.SweepLine:
    means = [over_seeds(values) for values in seeds]
    halves = [mean.half_width for mean in means]
    return plots.SweepLine(_short(estimator), [mean.mean for mean in means], halves, seeds)


def lesson_figure(plan: SweepPlan, results: Sequence[PointResult], name: str) -> CaptionedFigure:
    """Errors of all variations of a plan, and lost tracking if there is some, for a page."""
    errors, lost = [], []
    for index in range(len(plan.vary)):
        values = _value_results(results, index)
        title = _varied_title(plan, index)
        errors.append(_ate_panel(plan, title, values))
        lines = _error_lines(plan, values, lost_percent)
        labels = [label for label, _ in values]
        lost.append(plots.SweepPanel(title, "lost (% of the time)", labels, lines))
    means = [mean for panel in lost for line in panel.lines for mean in line.means]
    is_lost = max(filter(math.isfinite, means), default=0.0) > MIN_LOST_PERCENT
    figure = plots.sweep_grid([errors, lost] if is_lost else [errors])
    return CaptionedFigure(name, figure, "Absolute trajectory error by varied value")


def _ate_panel(
    plan: SweepPlan, title: str, values: Sequence[tuple[str, list[PointResult]]]
) -> plots.SweepPanel:
    labels = [label for label, _ in values]
    lines = _error_lines(plan, values)
    return plots.SweepPanel(title, "ATE (% of path length)", labels, lines, "no trajectory")


def _sweep_section(
    plan: SweepPlan, results: Sequence[PointResult], variation: int | None, key: str
) -> Section:
    values = _value_results(results, variation)
    labels = [label for label, _ in values]
    rows = []
    for label, group in values:
        for estimator in plan.estimators:
            outcomes = _outcomes_of(group, estimator)
            failed = [outcome for outcome in outcomes if outcome.errors is None]
            kinds = {outcome.errors.kind for outcome in outcomes if outcome.errors is not None}
            seconds = over_seeds([each.seconds for each in outcomes if each.seconds is not None])
            without = f"{len(failed)} of {len(outcomes)} {failed[0].status}" if failed else ""
            taken = f"{seconds.mean:.1f}" if math.isfinite(seconds.mean) else ""
            cells = *_cells(outcomes), ", ".join(sorted(kinds)), taken, without
            rows.append((label, _short(estimator), *cells))
    caption = "Means over the seeds ± half of their 95 % interval by Student's t."
    tables = [ResultTable(caption, SWEEP_COLUMNS, tuple(rows))]
    tables += _failures(
        [outcome for _, group in values for result in group for outcome in result.outcomes]
    )
    name = f"{key}{'base' if variation is None else f'vary-{variation}'}"
    title, figures = _varied_title(plan, variation), []
    if variation is not None:
        figures.append(
            CaptionedFigure(
                f"{name}-errors",
                plots.sweep_figure(_ate_panel(plan, title, values)),
                "Absolute trajectory error by varied value, with its 95 % interval over the seeds; "
                "dots are single seeds",
            )
        )
    figures += _track_figures(plan, values, name)
    times = []
    for estimator in plan.estimators:
        groups = [_outcomes_of(group, estimator) for _, group in values]
        taken_s = [[each.seconds for each in group if each.seconds is not None] for group in groups]
        times.append(_line(estimator, taken_s))
    panel = plots.SweepPanel("" if variation is None else title, "time taken (s)", labels, times)
    caption = "Run time of the estimators"
    figures.append(CaptionedFigure(f"{name}-times", plots.sweep_figure(panel), caption))
    text = METHOD if variation is None else ""
    return Section(title, text, tables=tables, figures=figures, key=name)


def _track_figures(
    plan: SweepPlan, values: Sequence[tuple[str, list[PointResult]]], name: str
) -> list[CaptionedFigure]:
    """Figures of trajectories and of lost tracking, with the first seed of each value."""
    panels, rows = [], []
    for label, group in values:
        result = group[0]
        try:
            recording = Recording.read(result.run)
        except OmnisimError:
            rows += [
                plots.LostRow(_row_label(label, name), None, "no drive") for name in plan.estimators
            ]
            continue
        panels.append(_track_panel(label, recording, result.outcomes, result.estimates))
        rows += [
            _lost_row(_row_label(label, outcome.estimator), outcome, recording, result.estimates)
            for outcome in result.outcomes
        ]
    figures = []
    if panels:
        caption = "Aligned trajectories and the truth from above, first seed"
        figures.append(
            CaptionedFigure(f"{name}-tracks", plots.trajectories_figure(panels), caption)
        )
    caption = "Times without an estimate, first seed"
    return [*figures, CaptionedFigure(f"{name}-lost", plots.lost_figure(rows), caption)]


def _row_label(label: str, estimator: str) -> str:
    return _short(estimator) if label == BASE else f"{label}, {_short(estimator)}"


def _outcomes_of(results: Sequence[PointResult], estimator: str) -> list[Outcome]:
    """Outcomes of one estimator, one per seed."""
    return [each for result in results for each in result.outcomes if each.estimator == estimator]


def _failures(outcomes: Sequence[Outcome]) -> list[ResultTable]:
    failures = dict.fromkeys(
        (each.estimator, each.status, each.reason) for each in outcomes if each.status != "ok"
    )
    columns = ("estimator", "status", "reason")
    caption = "Estimators without a result."
    return [ResultTable(caption, columns, tuple(failures))] if failures else []


def _track_panel(
    title: str, recording: Recording, outcomes: Sequence[Outcome], folder: Path
) -> plots.TrackPanel:
    tracks = {}
    for outcome in outcomes:
        if outcome.errors is None:
            continue
        estimate = read_trajectory(folder / estimator_folder(outcome.estimator) / ESTIMATE)
        tracked = estimator_named(outcome.estimator).base_from_tracked(recording)
        poses = outcome.errors.alignment.apply(estimate.world_from_base) @ inverse(tracked)
        truth = true_trajectory(recording, estimate.times_s)
        used, nearest = match_times(estimate.times_s, truth.times_s)
        traveled_m = np.concatenate(([0.0], np.cumsum(step_lengths_m(truth.world_from_base))))
        offsets = np.linalg.norm(poses[used, :3, 3] - truth.positions_m[nearest], axis=1)
        ends_s = float(truth.times_s[0]), float(truth.times_s[-1])
        lost_m = []
        for start_s, end_s in lost_intervals(estimate.times_s[used], *ends_s):
            inside = (truth.times_s >= start_s) & (truth.times_s <= end_s)
            if end_s - start_s > MIN_LOST * (ends_s[1] - ends_s[0]):
                lost_m.append(truth.positions_m[inside])
        name = _short(outcome.estimator)
        tracks[name] = plots.TrackDrawing(poses[:, :3, 3], lost_m, traveled_m[nearest], offsets)
    order = [_short(outcome.estimator) for outcome in outcomes]
    return plots.TrackPanel(title, recording.fine_truth.positions_m, tracks, order)


def _lost_row(label: str, outcome: Outcome, recording: Recording, folder: Path) -> plots.LostRow:
    if outcome.errors is None:
        return plots.LostRow(label, None, f"{outcome.status}: {outcome.reason}"[:110])
    estimate = read_trajectory(folder / estimator_folder(outcome.estimator) / ESTIMATE)
    truth_s = recording.state_times_s
    first_s, span_s = float(truth_s[0]), float(truth_s[-1] - truth_s[0]) or 1.0
    lost = lost_intervals(estimate.times_s, first_s, float(truth_s[-1]))
    shares = [((start - first_s) / span_s, (end - first_s) / span_s) for start, end in lost]
    return plots.LostRow(label, shares)


def _short(name: str) -> str:
    return name if len(name) <= MAX_NAME else name[: MAX_NAME - 1] + "…"
