"""Sections of the report about images, colors, landmarks and degradations."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise

import numpy as np

from omnisim.core.arrays import Floats
from omnisim.perception.landmarks.color_model import Training
from omnisim.perception.localization.filter import FilterParameters
from omnisim.plots import localization_plots as plots
from omnisim.plots.style import gallery
from omnisim.report.report import CaptionedFigure, Measure, ResultTable, Section
from omnisim.runs.run_data import RunLabels
from omnisim.validation.experiments.detection_accuracy import DetectionMatch, accuracy
from omnisim.validation.experiments.experiment_runs import RealExperiment, SimulationExperiment
from omnisim.validation.experiments.recordings import Progress, Recordings
from omnisim.validation.experiments.sweep import CAUSES, Outcome, sweep

EDGES_M = np.arange(0.0, 6.01, 0.5)


def images(
    runs: Recordings, trained: Training, simulated: SimulationExperiment, real: RealExperiment
) -> Section:
    """Fig. 11: both settings side by side, with detections."""
    steps = (4, 20, 47)
    shown = {f"real setting, step {step}": runs.real.image(step) for step in steps}
    shown |= {f"simulation, step {step}": runs.simulated.image(step) for step in steps}
    rows = []
    for name, experiment in (("simulation", simulated), ("real setting", real)):
        counts = np.array([len(of_step) for of_step in experiment.detections])
        half = len(counts) // 2
        for step in (int(counts[:half].argmax()), half + int(counts[half:].argmax())):
            panorama = experiment.detector.panorama(experiment.run.image(step))
            rows.append((f"{name}, step {step}", panorama, experiment.detections[step]))
    return Section(
        "Fig. 11: images side by side",
        "Simulation: a P2AT with an ideal camera. Real setting, as simulated here: a Super Scout "
        "among boxes with colors like the landmarks', a lamp over one corner, and a camera with "
        "defocus, motion blur, auto-exposure, noise, dirt and a color mosaic. Colors are trained "
        f"on {trained.images} clean images of another drive.",
        figures=(
            CaptionedFigure("fig11-images", gallery(shown, 3),
                    "The same field in the real setting (above), blurred and noisy, and in the "
                    "simulation (below)."),
            CaptionedFigure("fig11-detections", plots.detections_figure(rows),
                    "Panoramas with detections, for the images with the most detections. In the "
                    "simulation every box contains a landmark. In the real setting most landmarks "
                    "are missed, and some boxes are false positives."),
        ),
    )  # fmt: skip


def colors(trained: Training, simulated: SimulationExperiment, real: RealExperiment) -> Section:
    """Eq. 3: pixel classification by histograms, clean and degraded."""
    model = trained.model
    rows = []
    for index, name in enumerate(model.colors):
        clean, degraded = simulated.pixels, real.pixels
        rows.append(
            (name, f"{model.thresholds[index]:.4g}",
             f"{100 * clean.recall[name]:.1f} %", f"{100 * degraded.recall[name]:.1f} %",
             f"{1e6 * clean.false_alarms[name]:.1f}", f"{1e6 * degraded.false_alarms[name]:.1f}",
             f"{clean.curves[name].area:.4f}", f"{degraded.curves[name].area:.4f}")
        )  # fmt: skip
    alarms = [1e6 * sum(each.pixels.false_alarms.values()) for each in (simulated, real)]
    numbers = [
        Measure("false positives of all colors, clean", alarms[0], "in a million pixels"),
        Measure("false positives of all colors, degraded", alarms[1], "in a million pixels",
               paper="“a large amount of false positives”"),
    ]  # fmt: skip
    curves = {
        title: [
            (name, experiment.pixels.curves[name], threshold)
            for name, threshold in zip(model.colors, model.thresholds, strict=True)
        ]
        for title, experiment in (("clean images", simulated), ("degraded images", real))
    }
    table = ResultTable(
        "Classified pixels on test drives. The threshold Θ of Eq. 3 has the lowest cost on "
        "held-out images, where a false positive costs as much as four misses.",
        ("color", "Θ", "found, clean", "found, degraded", "false in 10⁶, clean",
         "false in 10⁶, degraded", "area, clean", "area, degraded"),
        tuple(rows),
    )  # fmt: skip
    return Section(
        "Eq. 3: color histograms",
        "Four histograms of 32³ bins. Most missed pixels are at the edge of a landmark, where its "
        "color mixes with the background.",
        numbers,
        (table,),
        (CaptionedFigure("roc", plots.roc_figure(curves),
                 "True positive rate over false positive rate of each color; dots are the "
                 "thresholds."),),
    )  # fmt: skip


def detection(simulated: SimulationExperiment, real: RealExperiment) -> Section:
    """Recall, precision, and errors of range and bearing."""
    near, three = accuracy(simulated.matches, 0.0, 4.0), accuracy(simulated.matches, 0.0, 3.0)
    names = {each.landmark for each in simulated.matches}
    each_name = {
        name: accuracy([each for each in simulated.matches if each.landmark == name], 0.0, 4.0)
        for name in sorted(names)
    }
    worst = accuracy(real.matches, 0.0, 4.0)
    numbers = [
        Measure("recall within 4 m, of the landmark that has least",
               min(each.recall for each in each_name.values()), "", 0.95, True),
        Measure("precision within 4 m, of the landmark that has least",
               min(each.precision for each in each_name.values()), "", 0.98, True),
        Measure("bearing error within 3 m, RMS", math.degrees(three.bearing_rms_rad), "°", 0.5),
        Measure("range error within 3 m, RMS", 100.0 * three.range_rms_share, "%", 5.0),
        Measure("the same by the inverse of Eq. 2", 100.0 * three.range_eq2_rms_share, "%"),
        Measure("range by Eq. 2 less that by the exact relation, mean within 4 m",
               1e3 * near.eq2_mean_m, "mm"),
        Measure("processor time of one image of 360 × 360, median",
               simulated.milliseconds, "ms", 30.0),
        Measure("recall within 4 m, real setting", worst.recall),
        Measure("precision within 4 m, real setting", worst.precision),
    ]  # fmt: skip
    rows = tuple(
        (name, f"{each.recall:.3f}", f"{each.precision:.3f}",
         f"{math.degrees(each.bearing_rms_rad):.3f}°", f"{100 * each.range_rms_share:.2f} %",
         str(each.count))
        for name, each in each_name.items()
    )  # fmt: skip
    return Section(
        "Landmarks",
        "Range and bearing of detected landmarks, against the truth. A beacon's range is computed "
        "from the edges of its bands, a goal's from its nearest foot. A detection is a false "
        "positive if its bearing error is more than 3°, or its range error is more than both a "
        "quarter of the range and three of its own standard deviations. The limits of distance "
        "apply to true distances.",
        numbers,
        (ResultTable("Within 4 m, clean.",
               ("landmark", "recall", "precision", "bearing, RMS", "range, RMS", "found"), rows),),
        (CaptionedFigure("recall", plots.rates_figure({"clean": _rates(simulated.matches),
                                         "real setting": _rates(real.matches)}),
                 "In clean images nearly all landmarks within 4 m are detected, without false "
                 "positives. In the real setting few are, and some detections are boxes."),),
    )  # fmt: skip


def _rates(matches: Sequence[DetectionMatch]) -> plots.Rates:
    by_distance = [accuracy(matches, low, high) for low, high in pairwise(EDGES_M)]
    return plots.Rates(
        EDGES_M,
        np.array([each.recall for each in by_distance]),
        np.array([each.precision for each in by_distance]),
    )


def degradations(
    simulated: SimulationExperiment,
    trained: Training,
    parameters: FilterParameters,
    progress: Progress,
) -> Section:
    """Effect of each degradation alone, with increasing strength."""
    run, model, wheels = simulated.run, trained.model, simulated.odometry_errors
    labels = RunLabels(run, model.colors)
    clean, outcomes = sweep(run, labels, model, wheels, parameters, progress)
    rows = [("none", "", *_cells(clean))]
    for cause in CAUSES:
        for level, outcome in zip(cause.levels, outcomes[cause.name], strict=True):
            rows.append((cause.name, f"{level:g} {cause.unit}", *_cells(outcome)))
    levels = ("none", "1", "2", "3")

    def lines(value: Callable[[Outcome], float]) -> list[tuple[str, Floats]]:
        return [
            (cause.name, np.array([value(each) for each in (clean, *outcomes[cause.name])]))
            for cause in CAUSES
        ]

    panels = {
        "mean position error (m)": lines(lambda each: each.error_m),
        "recall within 4 m": lines(lambda each: each.recall),
        "false positives (share of pixels)": lines(lambda each: each.false_alarms),
    }
    return Section(
        "Each degradation alone",
        "The comparison suggested in the paper's discussion. The images of experiment 1 have one "
        "degradation at a time. Colors are trained on clean images, and the start is known.",
        tables=(
            ResultTable("Landmarks within 4 m; position error: mean after step 5, median of 5 "
                  "seeds.",
                  ("degradation", "level", "recall", "precision", "bearing, RMS", "range, RMS",
                   "false pixels in 10⁶", "position error"), tuple(rows)),
        ),
        figures=(
            CaptionedFigure("degradations", plots.curves_figure(panels, levels),
                    "Levels as in the table. Color shifts, by white balance and light, cause the "
                    "largest errors; noise the most false positives; blur loses far landmarks."),
        ),
    )  # fmt: skip


def _cells(outcome: Outcome) -> Iterator[str]:
    yield f"{outcome.recall:.3f}"
    yield f"{outcome.precision:.3f}"
    yield f"{math.degrees(outcome.bearing_rms_rad):.2f}°"
    yield f"{100.0 * outcome.range_rms_share:.1f} %"
    yield f"{1e6 * outcome.false_alarms:.0f}"
    yield f"{outcome.error_m:.3f} m"
