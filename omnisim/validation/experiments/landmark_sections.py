"""Sections of the report about images, colors, landmarks and degradations."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np
from scipy import ndimage
from scipy.signal import fftconvolve

from omnisim.core.arrays import Bools, Bytes, Floats, Floats32
from omnisim.core.srgb import linear_from_srgb8, srgb8_from_linear
from omnisim.core.trajectories.odometry import OdometryErrors
from omnisim.perception.landmarks.color_model import ColorModel, Training
from omnisim.perception.landmarks.landmark_detector import LandmarkDetector
from omnisim.perception.localization.filter import FilterParameters, LandmarkMap
from omnisim.plots import localization_plots as plots
from omnisim.plots.style import gallery
from omnisim.rendering.camera.degradations import Jpeg, Vignetting, WhiteBalance
from omnisim.rendering.camera.degradations.defocus import covered_share
from omnisim.rendering.camera.degradations.image_geometry import ImageGeometry
from omnisim.report.report import CaptionedFigure, Measure, ResultTable, Section
from omnisim.runs.run_data import RunData, RunLabels
from omnisim.validation.experiments.experiment_runs import (
    DetectionMatch,
    RealExperiment,
    SimulationExperiment,
    accuracy,
    compare,
    observations_from_detections,
    run_seeds,
)
from omnisim.validation.experiments.recordings import Progress, Recordings

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
        Measure("false positives of all colors, clean", alarms[0], "per million pixels"),
        Measure("false positives of all colors, degraded", alarms[1], "per million pixels",
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
        Measure("recall within 4 m, worst landmark",
               min(each.recall for each in each_name.values()), "", 0.95, True),
        Measure("precision within 4 m, worst landmark",
               min(each.precision for each in each_name.values()), "", 0.98, True),
        Measure("bearing error within 3 m, RMS", math.degrees(three.bearing_rms_rad), "°", 0.5),
        Measure("range error within 3 m, RMS", 100.0 * three.range_rms_share, "%", 5.0),
        Measure("the same by the inverse of Eq. 2", 100.0 * three.range_eq2_rms_share, "%"),
        Measure("range by Eq. 2 minus range by the exact relation, mean within 4 m",
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

    def lines(value: Callable[[SectionOutcome], float]) -> list[tuple[str, Floats]]:
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


def _cells(outcome: SectionOutcome) -> Iterator[str]:
    yield f"{outcome.recall:.3f}"
    yield f"{outcome.precision:.3f}"
    yield f"{math.degrees(outcome.bearing_rms_rad):.2f}°"
    yield f"{100.0 * outcome.range_rms_share:.1f} %"
    yield f"{1e6 * outcome.false_alarms:.0f}"
    yield f"{outcome.error_m:.3f} m"


# Effect of each degradation alone on pixels, landmarks and self-localization.
#
# The recorded clean images are degraded in NumPy, one degradation at a time, with increasing
# strength; nothing is rendered again. Defocus and noise are faster versions of those in
# `omnisim.rendering.camera.degradations`. Motion blur is that of a turn on the spot, which rotates
# the image about its middle: straight motion blurs less.


NEAR_M = 4.0
SEEDS = 5  # of the odometry noise, at each level
READ_NOISE_E = 5.0
_SRGB = srgb8_from_linear(np.linspace(0.0, 1.0, 4096))
Light = Floats32  # (height, width, 4) linear; the fourth is 1 where the scene is visible


@dataclass(frozen=True)
class Cause:
    """Degradation in the sweep."""

    name: str  # name in the report
    unit: str  # unit of the levels
    levels: tuple[float, ...]  # levels in increasing strength
    # function that degrades light at a level and step
    apply: Callable[[Light, ImageGeometry, float, int], Light]


@dataclass(frozen=True)
class SectionOutcome:
    """Results at one level of a degradation."""

    # rates for landmarks within `NEAR_M`
    recall: float
    precision: float
    bearing_rms_rad: float  # RMS bearing error of true positives
    range_rms_share: float  # RMS range error of true positives, as a share of the range
    false_alarms: float  # share of pixels without a landmark that are taken for a landmark's color
    error_m: float  # median over seeds of the mean position error


def _defocus(light: Light, geometry: ImageGeometry, level: float, step: int) -> Light:
    """Mean of visible pixels over a disc of `level` px radius, as `Defocus`, by FFT."""
    reach = math.ceil(level)
    span = range(-reach, reach + 1)
    radius = np.array(level, dtype=np.float32)
    disc = np.array([[covered_share(right, down, radius) for right in span] for down in span])
    disc = (disc / disc.sum()).astype(np.float32)[..., None]
    share = light[..., 3:]
    blurred = fftconvolve(light[..., :3] * share, disc, mode="same", axes=(0, 1))
    weight = fftconvolve(share, disc, mode="same", axes=(0, 1))
    result = light.copy()
    result[..., :3] = blurred / np.maximum(weight, np.float32(1e-3))
    return result


def _motion_blur(light: Light, geometry: ImageGeometry, level: float, step: int) -> Light:
    """Mean over a rotation by `level` degrees about the middle of the image."""
    count = 2 + math.ceil(level)
    total = np.zeros_like(light)
    u0, v0 = geometry.center_px
    for angle in np.radians(level) * (np.arange(count) / (count - 1) - 0.5):
        cosine, sine = math.cos(angle), math.sin(angle)
        matrix = np.array([[cosine, -sine], [sine, cosine]])  # of (row, column)
        offset = np.array([v0, u0]) - matrix @ (v0, u0)
        for channel in range(4):
            total[..., channel] += ndimage.affine_transform(
                light[..., channel], matrix, offset, order=1, mode="nearest", output=np.float32
            )
    return total / np.float32(count)


def _noise(light: Light, geometry: ImageGeometry, level: float, step: int) -> Light:
    """Gaussian shot and read noise with the variances of `Noise`, for a full well of `level`."""
    generator = np.random.default_rng([2, step])
    colors = np.maximum(light[..., :3], np.float32(0.0))
    sigma = np.sqrt(colors * np.float32(level) + np.float32(READ_NOISE_E**2)) / np.float32(level)
    noisy = light.copy()
    noisy[..., :3] += sigma * generator.standard_normal(colors.shape, dtype=np.float32)
    return noisy


def _darkness(light: Light, geometry: ImageGeometry, level: float, step: int) -> Light:
    """Changing light: a wave of `level` stops over 24 steps."""
    ev = -0.5 * level * (1.0 - math.cos(2.0 * math.pi * step / 24.0))
    dimmed = light.copy()
    dimmed[..., :3] *= np.float32(2.0**ev)
    return dimmed


def _white_balance(light: Light, geometry: ImageGeometry, level: float, step: int) -> Light:
    """White balance that is too warm: red is multiplied, and blue divided, by 1 + `level`."""
    gains = (1.0 + level, 1.0, 1.0 / (1.0 + level))
    return WhiteBalance(response=(1.0, 1.0, 1.0), gains=gains).apply(light, geometry)


CAUSES = (
    Cause("defocus", "px radius", (1.0, 2.0, 4.0), _defocus),
    Cause("motion blur", "° of a turn", (1.0, 3.0, 8.0), _motion_blur),
    Cause("noise", "electrons full well", (4000.0, 600.0, 100.0), _noise),
    Cause("vignetting", "light lost at the rim", (0.2, 0.45, 0.7),
          lambda light, geometry, level, _: Vignetting((-level, 0.0, 0.0)).apply(light, geometry)),
    Cause("changing light", "stops", (0.5, 1.0, 2.0), _darkness),
    Cause("white balance", "red gain", (0.05, 0.12, 0.25), _white_balance),
    Cause("JPEG", "quality", (80.0, 40.0, 12.0), lambda light, *_: light),
)  # fmt: skip


def sweep(
    run: RunData,
    labels: Callable[[int], Bytes],
    model: ColorModel,
    wheels: OdometryErrors,
    parameters: FilterParameters,
    progress: Progress,
) -> tuple[SectionOutcome, Mapping[str, list[SectionOutcome]]]:
    """Outcome without degradation; and for each cause, by name, the outcomes of its levels."""
    detector = LandmarkDetector(model, run.landmarks, run.mount)
    geometry = ImageGeometry.of_camera(run.mount.camera)
    images = list(run.images())
    truth = [labels(step) for step in range(run.steps)]
    covered = run.mount.covered
    shown = np.ones(images[0].shape[:2], bool) if covered is None else covered

    def evaluate(change: Callable[[Bytes, int], Bytes]) -> SectionOutcome:
        detections, alarms, others = [], 0, 0
        for step, image in enumerate(images):
            changed = change(image, step)
            detections.append(detector(changed))
            if step % 6 == 0:
                neg = shown & (truth[step] == 0)
                alarms += int(np.count_nonzero(model.classify(changed[neg])))
                others += int(np.count_nonzero(neg))
        poses = run.true_poses
        assert poses is not None
        landmarks = LandmarkMap.of_scene(run.landmarks)
        near = accuracy(compare(detections, poses, landmarks, run.mount.position_m), 0.0, NEAR_M)
        seen = observations_from_detections(detections, parameters)
        seeds = run_seeds(run, wheels, [seen] * SEEDS, parameters)
        error_m = float(np.median(seeds.errors_m[:, 5:].mean(axis=1)))
        rms = near.bearing_rms_rad, near.range_rms_share
        return SectionOutcome(near.recall, near.precision, *rms, alarms / max(others, 1), error_m)

    tasks = [(cause, level) for cause in CAUSES for level in cause.levels]
    outcomes: dict[str, list[SectionOutcome]] = {cause.name: [] for cause in CAUSES}
    for index in progress("degradations, one by one", len(tasks))(range(len(tasks))):
        cause, level = tasks[index]
        change = partial(degraded, shown=shown, geometry=geometry, cause=cause, level=level)
        outcomes[cause.name].append(evaluate(change))
    return evaluate(lambda image, _: image), outcomes


def degraded(
    image: Bytes, step: int, shown: Bools, geometry: ImageGeometry, cause: Cause, level: float
) -> Bytes:
    """Image (height, width, 3), sRGB, with one degradation."""
    light = np.concatenate((linear_from_srgb8(image), shown[..., None].astype(np.float32)), axis=-1)
    light = cause.apply(light, geometry, level, step)
    steps = np.rint(np.clip(light[..., :3], 0.0, 1.0) * np.float32(len(_SRGB) - 1))
    rgba = np.concatenate((_SRGB[steps.astype(np.int32)], shown[..., None] * np.uint8(255)), axis=2)
    rgba[~shown] = 0
    if cause.name == "JPEG":
        rgba = Jpeg(quality=int(level), subsampling="4:2:0").compressed(rgba)
    return np.ascontiguousarray(rgba[..., :3])
