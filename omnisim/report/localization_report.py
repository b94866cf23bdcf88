"""Files and report of a localized run, from `omnisim localize`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from omnisim.core.arrays import Bytes, Floats
from omnisim.core.files.atomic_file import make_folder
from omnisim.perception.landmarks.landmark_detector import Detection, write_detections
from omnisim.perception.localization.filter import FilterParameters
from omnisim.perception.localization.track import Track, mean_interval, notices, write_track
from omnisim.plots.localization_plots import (
    PathPanel,
    detections_figure,
    errors_figure,
    paths_figure,
)
from omnisim.report.report import CaptionedFigure, Measure, Report, Section
from omnisim.runs.run_data import RunData

LATE_STEP = 5  # errors are reported from this step on: the paper's start is worse than odometry


def write_localized(
    folder: Path,
    run: RunData,
    track: Track,
    parameters: FilterParameters,
    detections: Sequence[Sequence[Detection]],
    shown: Sequence[tuple[str, Bytes, Sequence[Detection]]],
    warnings: Sequence[str] = (),
) -> Report:
    """Write tracks, detections and the report of a localized run.

    Args:
        folder: folder to write to, created if missing.
        run: run; ground truth, if there is any, is used for the errors only.
        track: estimates of the run's steps.
        parameters: parameters of the filter.
        detections: detections by step.
        shown: title, panorama (height, width, 3) in sRGB, and detections of each shown image.
        warnings: warnings for the reader.

    Raises:
        OutputError: a file cannot be written.
    """
    make_folder(folder)
    write_track(folder, track)
    write_detections(
        folder / "detections.csv",
        ((step, each) for step, at_step in enumerate(detections) for each in at_step),
    )
    report = Report(
        f"Localization of {run.name}",
        "The robot's position, estimated by an extended Kalman filter from wheel odometry and the "
        "landmarks in its images.",
        (_section(run, track, parameters, shown, warnings),),
        {"parameters": parameters.to_table(full=True), "steps": len(track.estimates)},
    )
    report.write(folder)
    return report


def _section(
    run: RunData,
    track: Track,
    parameters: FilterParameters,
    shown: Sequence[tuple[str, Bytes, Sequence[Detection]]],
    warnings: Sequence[str],
) -> Section:
    truth = run.true_poses
    panel = PathPanel(run.name, track, truth, run.landmarks)
    figures = [
        CaptionedFigure("fig11-detections", detections_figure(shown),
                "Panoramas with the detections: each box encloses a landmark."),
        CaptionedFigure("fig12-paths", paths_figure([panel]),
                "From above: the estimate, with 3σ ellipses, and odometry alone."),
    ]  # fmt: skip
    warnings = [*warnings, *notices(track, parameters)]
    if truth is None:
        warnings.append("The run has no ground truth: no errors are shown.")
    else:
        figures.append(
            CaptionedFigure("fig13-errors", errors_figure([panel]),
                    "Distance from the true position, and number of accepted landmarks.")
        )  # fmt: skip
    text, measures = "Successors of the paper's Fig. 11, 12 and 13.", track_measures(track, truth)
    return Section(run.name, text, measures, figures=figures, notices=warnings)


def track_measures(track: Track, truth: Floats | None) -> list[Measure]:
    """Measures of a single track."""
    accepted, rejected = int(track.counts(True).sum()), int(track.counts(False).sum())
    opens = track.gate_opening_step
    measures = [
        Measure("landmarks accepted by the gate", accepted),
        Measure("landmarks rejected by the gate", rejected),
        Measure("step at which the gate opens", math.nan if opens is None else opens,
               paper="23 in the real setting, 1 in simulation"),
    ]  # fmt: skip
    if truth is None:
        return measures
    errors, wheels = track.errors_m(truth), track.reckoned_errors_m(truth)
    late = slice(min(LATE_STEP, len(errors) - 1), None)
    nees = track.nees(truth)
    known = nees[np.isfinite(nees)]
    measures += [
        Measure(f"largest error after step {LATE_STEP}", float(errors[late].max()), "m",
               paper="below 0.6 m, real and simulated"),
        Measure(f"mean error after step {LATE_STEP}", float(errors[late].mean()), "m"),
        Measure("largest error of wheel odometry alone", float(wheels.max()), "m",
               paper="well above 1 m"),
        Measure("NEES, mean of the run (3 expected)",
               float(known.mean()) if len(known) else math.nan),
    ]  # fmt: skip
    updated = [estimate for estimate in track.estimates if estimate.nis_degrees]
    if degrees := sum(estimate.nis_degrees for estimate in updated):
        low, high = mean_interval(1, degrees)
        name = f"NIS over its degrees of freedom (95 % band {low:.2f} to {high:.2f})"
        nis = sum(estimate.nis for estimate in updated) / degrees
        measures.append(Measure(name, nis))
    return measures
