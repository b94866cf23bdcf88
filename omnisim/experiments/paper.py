"""The paper's two experiments of section 3.2, their successors, and what lies beyond: one page.

Everything that is measured is held against its bound here, with what the paper has beside it.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omnisim.experiments.detecting import Found, accuracy, compare
from omnisim.experiments.hand_picking import Hand, pick_landmarks
from omnisim.experiments.localizing import sighting_of
from omnisim.experiments.page import Number, Page, Picture, Section, Table, make_folder
from omnisim.experiments.real_setting import put_down_wrongly
from omnisim.experiments.recordings import Recordings, record_all
from omnisim.experiments.run_data import RunData
from omnisim.experiments.run_labels import RunLabels
from omnisim.experiments.seeds import (
    Progress,
    SeedRuns,
    ahead_only,
    detect_with_noise,
    run_seeds,
)
from omnisim.experiments.sweep import CAUSES, Outcome, sweep
from omnisim.experiments.training import PixelRates, Training, pixel_rates, train_on_run
from omnisim.localization.filter import LocalizationFilter
from omnisim.localization.parameters import FilterParameters, read_parameters
from omnisim.localization.sightings import LandmarkMap, Sighting
from omnisim.localization.track import notices
from omnisim.perception.color_model import Costs, count_colors
from omnisim.perception.color_model_file import save_model
from omnisim.perception.landmark_detector import Detection, LandmarkDetector
from omnisim.plots.detection_plots import (
    Rates,
    curves_figure,
    detections_figure,
    rates_figure,
    roc_figure,
)
from omnisim.plots.localization_plots import (
    PathPanel,
    consistency_figure,
    errors_figure,
    paths_figure,
    seeds_figure,
)
from omnisim.plots.style import gallery
from omnisim.simulation import Vehicle

REAL_PARAMETERS = Path(__file__).with_name("real_setting.toml")
SEEDS = 20
LATE_STEP = 5
PAPER_BOUND_M, SIMULATED_BOUND_M = 0.6, 0.5
DIAGONAL_STEPS = 12  # the last ones of the lap
FORWARD_RAD = math.radians(90.0)
EDGES_M = np.arange(0.0, 6.01, 0.5)


def run_experiments(folder: Path, device: int | None, progress: Progress) -> Page:
    """Record, learn, localize, and write the page; what is recorded already is kept.

    Raises:
        OmnisimError: no OpenGL, or files that cannot be written.
    """
    make_folder(folder)
    runs = record_all(folder, device, progress)
    trained = train_on_run(runs.learning, Costs(), progress("colours", runs.learning.steps))
    save_model(folder / "model.npz", trained.model, runs.learning.landmarks)
    parameters = read_parameters()
    simulated = _Simulated(runs.simulated, trained, parameters, progress)
    real = _Real(runs.real, trained, parameters, progress)
    sections = (
        _pictures(runs, trained, simulated, real),
        _colors(trained, simulated, real),
        _detection(simulated, real),
        _first_experiment(simulated),
        _second_experiment(real),
        _side_by_side(simulated, real),
        _gains(simulated),
        _degradations(simulated, trained, parameters, progress),
    )
    page = Page(
        "A robot finds itself",
        "The experiments of Schmits and Visser (2008), section 3.2, on omnisim, and what lies "
        "beyond them. The paper publishes neither its noise, nor its gate, nor its bins and "
        "thresholds: all parameters are ours. The paper's numbers stand beside ours where it has "
        "some.",
        sections,
        {"seeds": SEEDS, "parameters": parameters.model_dump()},
    )
    page.write(folder)
    return page


class _Simulated:
    """Experiment 1: all that is computed of it."""

    def __init__(
        self, run: RunData, trained: Training, parameters: FilterParameters, progress: Progress
    ):
        self.run, self.parameters = run, parameters
        self.detector = LandmarkDetector(trained.model, run.landmarks, run.mount)
        self.detections, self.milliseconds = _timed(run, self.detector, progress)
        self.found = _compared(run, self.detections)
        self.pixels = _pixel_rates(run, trained, progress)
        self.wheels = Vehicle.load("p2at").odometry
        noisy = detect_with_noise(run, self.detector, SEEDS, progress)
        self.sightings = [_sightings(each, parameters) for each in noisy]
        self.seeds = run_seeds(run, self.wheels, self.sightings, parameters)


class _Real:
    """Experiment 2: all that is computed of it."""

    def __init__(
        self, run: RunData, trained: Training, parameters: FilterParameters, progress: Progress
    ):
        self.run = run
        self.parameters = read_parameters(REAL_PARAMETERS)
        self.detector = LandmarkDetector(trained.model, run.landmarks, run.mount)
        self.detections, self.milliseconds = _timed(run, self.detector, progress)
        self.found = _compared(run, self.detections)
        self.pixels = _pixel_rates(run, trained, progress)
        self.wheels = Vehicle.load("superscout").odometry
        self.sightings = [_picked(run, seed) for seed in range(SEEDS)]
        certain = np.zeros((3, 3))
        self.seeds = run_seeds(
            run, self.wheels, self.sightings, self.parameters, certain, put_down_wrongly
        )
        self.honest = run_seeds(
            run, self.wheels, self.sightings, parameters, certain, put_down_wrongly
        )
        automatic = _sightings(self.detections, parameters)
        self.automatic = run_seeds(run, self.wheels, [automatic] * SEEDS, parameters)


def _timed(
    run: RunData, detector: LandmarkDetector, progress: Progress
) -> tuple[list[list[Detection]], float]:
    """Detections of all steps, and the median time of one picture in milliseconds.

    Time of this thread: what else the machine does is not counted.
    """
    found, times = [], []
    for step in progress(f"landmarks: {run.folder.path.name}", run.steps)(range(run.steps)):
        picture = run.picture(step)
        start = time.thread_time()
        found.append(detector(picture))
        times.append(time.thread_time() - start)
    return found, 1e3 * float(np.median(times))


def _compared(run: RunData, detections: Sequence[Sequence[Detection]]) -> list[Found]:
    poses = run.true_poses
    assert poses is not None
    landmarks = LandmarkMap.of_scene(run.landmarks)
    return compare(detections, poses, landmarks, run.mount.position_m)


def _pixel_rates(run: RunData, trained: Training, progress: Progress) -> PixelRates:
    labels = RunLabels(run, trained.model.colors)
    covered = run.mount.covered
    counts: NDArray[np.float64] | float = 0.0
    for step in progress(f"pixels: {run.folder.path.name}", run.steps)(range(run.steps)):
        pixels, classes = run.picture(step)[covered], labels(step)[covered]
        counts = counts + count_colors(
            pixels.reshape(-1, 3), classes.ravel(), 1 + len(trained.model.colors)
        )
    assert isinstance(counts, np.ndarray)
    return pixel_rates(trained.model, counts)


def _sightings(
    detections: Sequence[Sequence[Detection]], parameters: FilterParameters
) -> list[list[Sighting]]:
    return [[sighting_of(each, parameters.measurement) for each in step] for step in detections]


def _picked(run: RunData, seed: int) -> list[list[Sighting]]:
    """What somebody picks by hand in the pictures of a run."""
    generator = np.random.default_rng([3, seed])
    landmarks = LandmarkMap.of_scene(run.landmarks)
    poses = run.true_poses
    assert poses is not None
    return [pick_landmarks(pose, run.mount, landmarks, Hand(), generator) for pose in poses]


def _pictures(runs: Recordings, trained: Training, simulated: _Simulated, real: _Real) -> Section:
    steps = (4, 20, 47)
    shown = {f"real setting, step {step}": runs.real.picture(step) for step in steps}
    shown |= {f"simulation, step {step}": runs.simulated.picture(step) for step in steps}
    rows = [
        (f"{name}, step {step}", each.detector.panorama(each.run.picture(step)),
         each.detections[step])
        for name, each in (("simulation", simulated), ("real setting", real))
        for step in _telling(each.detections)
    ]  # fmt: skip
    return Section(
        "Fig. 11: pictures side by side",
        f"The real setting, as far as a simulator can go: a Super Scout among boxes in colours "
        "like the landmarks', a lamp over one corner, and a camera with defocus, motion blur, "
        "auto-exposure, noise, dirt and a colour mosaic. The simulation: a P2AT with an ideal "
        f"camera. Colours are learned from {trained.pictures} clean pictures of another drive.",
        pictures=(
            Picture("fig11-pictures", gallery(shown, 3),
                    "Above the real setting, below the simulation: the same field, blurred and "
                    "noisy above."),
            Picture("fig11-detections", detections_figure(rows),
                    "Panoramas with what is found: in the simulation every box is around a "
                    "landmark; in the real setting most are missed, even in the pictures with most "
                    "boxes that are shown here, and some are around something else."),
        ),
    )  # fmt: skip


def _telling(detections: Sequence[Sequence[Detection]]) -> list[int]:
    """Two steps in which much is found, far from each other."""
    counts = np.array([len(found) for found in detections])
    half = len(counts) // 2
    return [int(counts[:half].argmax()), half + int(counts[half:].argmax())]


def _colors(trained: Training, simulated: _Simulated, real: _Real) -> Section:
    model = trained.model
    numbers, rows = [], []
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
        Number("false positives of all colours, clean", alarms[0], "in a million pixels"),
        Number("false positives of all colours, degraded", alarms[1], "in a million pixels",
               paper="“a large amount of false positives”"),
    ]  # fmt: skip
    curves = {
        title: [
            (name, each.pixels.curves[name], model.thresholds[index])
            for index, name in enumerate(model.colors)
        ]
        for title, each in (("clean pictures", simulated), ("degraded pictures", real))
    }
    table = Table(
        "Pixels, on drives that nothing was learned from. A threshold Θ is that of Eq. 3 which "
        "costs least on held-out pictures, where a false alarm costs four misses.",
        ("colour", "Θ", "found, clean", "found, degraded", "false in 10⁶, clean",
         "false in 10⁶, degraded", "area, clean", "area, degraded"),
        tuple(rows),
    )  # fmt: skip
    return Section(
        "Eq. 3: colour histograms",
        "Four histograms of 32³ bins. Pixels on the edge of a landmark mix its colour with what is "
        "behind it, and are most of those that are missed.",
        numbers,
        (table,),
        (Picture("roc", roc_figure(curves),
                 "The share of a colour's pixels that is found against that of all others that "
                 "is taken for it; dots are the thresholds."),),
    )  # fmt: skip


def _detection(simulated: _Simulated, real: _Real) -> Section:
    near, three = accuracy(simulated.found, 0.0, 4.0), accuracy(simulated.found, 0.0, 3.0)
    names = {each.landmark for each in simulated.found}
    each_name = {
        name: accuracy([each for each in simulated.found if each.landmark == name], 0.0, 4.0)
        for name in sorted(names)
    }
    worst = accuracy(real.found, 0.0, 4.0)
    numbers = [
        Number("recall within 4 m, of the landmark that has least",
               min(each.recall for each in each_name.values()), "", 0.95, True),
        Number("precision within 4 m, of the landmark that has least",
               min(each.precision for each in each_name.values()), "", 0.98, True),
        Number("bearing error within 3 m, RMS", math.degrees(three.bearing_rms_rad), "°", 0.5),
        Number("range error within 3 m, RMS", 100.0 * three.range_rms_share, "%", 5.0),
        Number("the same by the inverse of Eq. 2", 100.0 * three.range_eq2_rms_share, "%"),
        Number("range by Eq. 2 less that by the exact relation, mean within 4 m",
               1e3 * near.eq2_mean_m, "mm"),
        Number("processor time of one picture of 360 × 360, median",
               simulated.milliseconds, "ms", 30.0),
        Number("recall within 4 m, real setting", worst.recall),
        Number("precision within 4 m, real setting", worst.precision),
    ]  # fmt: skip
    rows = tuple(
        (name, f"{told.recall:.3f}", f"{told.precision:.3f}",
         f"{math.degrees(told.bearing_rms_rad):.3f}°", f"{100 * told.range_rms_share:.2f} %",
         str(told.count))
        for name, told in each_name.items()
    )  # fmt: skip
    return Section(
        "Landmarks",
        "Range and bearing of what is found, against the truth. A beacon's range comes from the "
        "edges of its bands, a goal's from its nearest foot. What is more than 3° or a quarter of "
        "its range off counts as a false one.",
        numbers,
        (Table("Within 4 m, clean.",
               ("landmark", "recall", "precision", "bearing, RMS", "range, RMS", "found"), rows),),
        (Picture("recall", rates_figure({"clean": _rates(simulated.found),
                                         "real setting": _rates(real.found)}),
                 "Clean, nearly everything to 4 m is found, and nothing else; in the real setting "
                 "little is, and some of it is a box."),),
    )  # fmt: skip


def _rates(found: Sequence[Found]) -> Rates:
    told = [accuracy(found, low, high) for low, high in pairwise(EDGES_M)]
    return Rates(
        EDGES_M,
        np.array([each.recall for each in told]),
        np.array([each.precision for each in told]),
    )


def _first_experiment(simulated: _Simulated) -> Section:
    seeds = simulated.seeds
    late = seeds.errors_m[:, LATE_STEP:]
    by_step = seeds.nees_by_step
    band = seeds.nees_band
    mean = float(np.nanmean(by_step))
    inside = np.mean((by_step[1:] > band.low) & (by_step[1:] < band.high))
    numbers = [
        Number(f"largest error after step {LATE_STEP}, median of {SEEDS} seeds",
               float(np.median(late.max(axis=1))), "m", 0.25, paper="well below 0.5 m"),
        Number(f"mean error after step {LATE_STEP}, median",
               float(np.median(late.mean(axis=1))), "m", 0.10),
        Number("mean error on the diagonal, median",
               float(np.median(seeds.errors_m[:, -DIAGONAL_STEPS:].mean(axis=1))), "m", 0.10,
               paper="0.349 m"),
        Number("largest error by the wheels alone, median",
               float(np.median(seeds.reckoned_m.max(axis=1))), "m", paper="well above 1 m"),
        Number("step at which the gate opens, median", float(np.median(seeds.opens)),
               paper="1: instantly"),
        Number(f"NEES, mean of seeds and steps (3 expected), not above its 95 % band of {SEEDS}",
               mean, "", band.high),
        Number("the same, not below", mean, "", band.low, True),
        Number("share of the steps whose mean NEES is within the band", float(inside)),
        Number("NIS over its degrees of freedom, all steps",
               float(np.nansum(seeds.nis) / max(seeds.nis_degrees.sum(), 1))),
        Number("processor time of a step of the filter, median",
               _step_microseconds(simulated), "µs", 100.0),
    ]  # fmt: skip
    return Section(
        "Experiment 1: simulation",
        "P2AT, counter-clockwise and across; landmarks found automatically; the gate open from the "
        "start. All seeds see the same pictures, with noise of their own on the pixels and the "
        "wheels. What errors the pictures' rasters give to detections all seeds have in common, so "
        "that NEES, averaged over seeds, wanders about its mean more than independent runs would.",
        numbers,
        pictures=(
            Picture("seeds", seeds_figure(seeds.errors_m, seeds.reckoned_m,
                                          f"{SEEDS} seeds of experiment 1"),
                    "The estimate stays within millimetres while the wheels are off by a metre."),
            Picture("consistency", consistency_figure(by_step, band, seeds.nis_by_step,
                                                      seeds.nis_bands),
                    "NEES about 3, with the wandering that all seeds share; NIS below 1: what is "
                    "seen agrees better than it says."),
        ),
    )  # fmt: skip


def _second_experiment(real: _Real) -> Section:
    seeds = real.seeds
    opens = seeds.opens
    after = [
        float(errors[int(step) :].max())
        for errors, step in zip(seeds.errors_m, opens, strict=True)
        if math.isfinite(step)
    ]
    late = [
        float(errors[int(step) :].mean())
        for errors, step in zip(seeds.errors_m, opens, strict=True)
        if math.isfinite(step)
    ]
    wheels = seeds.reckoned_m.max(axis=1)
    numbers = [
        Number("step at which the gate opens, median", float(np.median(opens)), "",
               LATE_STEP + 1, True, paper="23"),
        Number("largest error after the gate opens, median",
               float(np.median(after)) if after else math.nan, "m", PAPER_BOUND_M,
               paper="within 0.6 m"),
        Number("mean error after the gate opens, median",
               float(np.median(late)) if late else math.nan, "m"),
        Number("largest error by the wheels alone, median", float(np.median(wheels)), "m",
               1.0, True, paper="well above 1 m at several steps"),
        Number("seeds of 20 whose gate opens later than step 5",
               float(np.sum(opens > LATE_STEP))),
        Number("seeds of 20 that stay within 0.6 m after it opens",
               float(np.sum(np.array(after) <= PAPER_BOUND_M))),
        Number("with experiment 1's noise instead: step at which the gate opens, median",
               float(np.median(real.honest.opens))),
        Number("with it: mean error after step 5, median",
               float(np.median(real.honest.errors_m[:, LATE_STEP:].mean(axis=1))), "m"),
        Number("landmarks found automatically and a start that is known: mean error, median",
               float(np.median(real.automatic.errors_m[:, LATE_STEP:].mean(axis=1))), "m"),
        Number("the same: largest error after step 5, median",
               float(np.median(real.automatic.errors_m[:, LATE_STEP:].max(axis=1))), "m"),
    ]  # fmt: skip
    return Section(
        "Experiment 2: real setting",
        "Super Scout, clockwise and across; landmarks within 3.5 m picked by hand with a noise of "
        "1.5 px; a start that is 0.14 m and 12° off and that the filter takes for certain; wheels "
        "with bias. What the filter is told of the wheels is less than they deserve: only then "
        "does it ignore landmarks for as long as the paper's did.",
        numbers,
        pictures=(
            Picture("seeds-real", seeds_figure(seeds.errors_m, seeds.reckoned_m,
                                               f"{SEEDS} seeds of experiment 2"),
                    "The estimate follows the wheels until the gate opens, and then the truth."),
        ),
    )  # fmt: skip


def _side_by_side(simulated: _Simulated, real: _Real) -> Section:
    chosen = _typical(real.seeds)
    first, second = simulated.seeds.tracks[0], real.seeds.tracks[chosen]
    panels = [
        PathPanel("real setting: Super Scout, clockwise", second, real.run.true_poses,
                  real.run.landmarks, PAPER_BOUND_M),
        PathPanel("simulation: P2AT, counter-clockwise", first, simulated.run.true_poses,
                  simulated.run.landmarks, SIMULATED_BOUND_M),
    ]  # fmt: skip
    told = [f"real setting: {notice}" for notice in notices(second, real.parameters)]
    told += [f"simulation: {notice}" for notice in notices(first, simulated.parameters)]
    return Section(
        "Fig. 12 and 13: paths and errors",
        f"One seed of each experiment: 0 of the simulation, {chosen} of the real setting, whose "
        "gate opens nearest to the median.",
        pictures=(
            Picture("fig12-paths", paths_figure(panels),
                    "Left the estimate leaves the truth and comes back when the gate opens; right "
                    "it lies on the truth, with ellipses of millimetres."),
            Picture("fig13-errors", errors_figure(panels),
                    "Left the gate rejects what is seen at first, and opens by itself; right it is "
                    "open from the start."),
        ),
        notices=told,
    )  # fmt: skip


def _typical(seeds: SeedRuns) -> int:
    opens = seeds.opens
    known = np.where(np.isfinite(opens), opens, 1e9)
    return int(np.abs(known - np.median(opens)).argmin())


def _gains(simulated: _Simulated) -> Section:
    full = simulated.seeds
    ahead = run_seeds(
        simulated.run,
        simulated.wheels,
        [ahead_only(each, FORWARD_RAD) for each in simulated.sightings],
        simulated.parameters,
    )
    seen = [np.mean([len(step) for step in each]) for each in simulated.sightings]
    seen_ahead = [
        np.mean([len(step) for step in ahead_only(each, FORWARD_RAD)])
        for each in simulated.sightings
    ]
    rows = []
    for name, errors, count in (
        ("wheels alone", full.reckoned_m, 0.0),
        ("90° ahead", ahead.errors_m, float(np.mean(seen_ahead))),
        ("all around", full.errors_m, float(np.mean(seen))),
    ):
        late = errors[:, LATE_STEP:]
        low, high = np.percentile(late.mean(axis=1), (2.5, 97.5))
        rows.append(
            (name, f"{count:.2f}", f"{np.median(late.mean(axis=1)):.4f}",
             f"{low:.4f} to {high:.4f}", f"{np.median(late.max(axis=1)):.4f}")
        )  # fmt: skip
    return Section(
        "What looking all around gains",
        "The same detections, of which a camera that looks forward with a field of view of 90° "
        "would have seen only those within 45° of the front: its range and resolution are taken to "
        "be as good. Where it sees nothing, the wheels lead.",
        tables=(
            Table("Experiment 1, 20 seeds, error after step 5 in metres.",
                  ("camera", "landmarks a picture", "mean error, median", "its 95 % band",
                   "largest error, median"), tuple(rows)),
        ),
        pictures=(
            Picture("seeds-ahead", seeds_figure(ahead.errors_m, ahead.reckoned_m,
                                                "with landmarks within 45° of the front only"),
                    "Errors grow wherever nothing stands ahead."),
        ),
    )  # fmt: skip


def _degradations(
    simulated: _Simulated, trained: Training, parameters: FilterParameters, progress: Progress
) -> Section:
    clean, found = sweep(
        simulated.run,
        RunLabels(simulated.run, trained.model.colors),
        trained.model,
        simulated.wheels,
        parameters,
        progress,
    )
    rows = [("none", "", *_cells(clean))]
    for cause in CAUSES:
        for level, outcome in zip(cause.levels, found[cause.name], strict=True):
            rows.append((cause.name, f"{level:g} {cause.unit}", *_cells(outcome)))
    levels = ("none", "1", "2", "3")
    panels = {
        title: [
            (cause.name, np.array([value(each) for each in (clean, *found[cause.name])]))
            for cause in CAUSES
        ]
        for title, value in (
            ("mean error of the place (m)", lambda each: each.error_m),
            ("recall within 4 m", lambda each: each.recall),
            ("false positives (share of pixels)", lambda each: each.false_alarms),
        )
    }
    return Section(
        "Each degradation alone",
        "What the paper's discussion asks for. The pictures of experiment 1 degraded one way at a "
        "time; colours are those learned from clean ones, and the start is known.",
        tables=(
            Table("Landmarks within 4 m; error of the place: mean after step 5, median of 5 seeds.",
                  ("degradation", "level", "recall", "precision", "bearing, RMS", "range, RMS",
                   "false pixels in 10⁶", "error of the place"), tuple(rows)),
        ),
        pictures=(
            Picture("degradations", curves_figure(panels, levels),
                    "Levels as in the table. What shifts colours costs most, white balance and "
                    "light; noise makes most false positives; blur costs what is far."),
        ),
    )  # fmt: skip


def _cells(outcome: Outcome) -> Iterator[str]:
    yield f"{outcome.recall:.3f}"
    yield f"{outcome.precision:.3f}"
    yield f"{math.degrees(outcome.bearing_rms_rad):.2f}°"
    yield f"{100.0 * outcome.range_rms_share:.1f} %"
    yield f"{1e6 * outcome.false_alarms:.0f}"
    yield f"{outcome.error_m:.3f} m"


def _step_microseconds(simulated: _Simulated) -> float:
    """Median time of a step of the filter with all that it sees."""
    run = simulated.run
    robot = LocalizationFilter(
        LandmarkMap.of_scene(run.landmarks), simulated.parameters, run.mount.position_m,
        float(run.odometry.times_s[0]), run.odometry.start,
    )  # fmt: skip
    times = []
    for k in range(1, run.steps):
        time_s = float(run.odometry.times_s[k])
        speed = float(run.odometry.distances_m[k - 1]) / (time_s - robot.estimate.time_s)
        turn = float(run.odometry.turns_rad[k - 1])
        start = time.thread_time()
        robot.step(time_s, speed, turn, simulated.sightings[0][k])
        times.append(time.thread_time() - start)
    return 1e6 * float(np.median(times))
