"""`omnisim landmarks` and `omnisim localize`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from omnisim.apps.cli.console import out, pluralize, print_note, track
from omnisim.apps.cli.inputs import read_sensor
from omnisim.apps.cli.options import refuse_given
from omnisim.apps.cli.runs.requests import DetectRequest, LocalizeRequest, TrainRequest
from omnisim.core.errors import LocalizationError, OpticsError
from omnisim.core.extras import require_extra
from omnisim.core.files.atomic_file import check_suffix, check_target
from omnisim.perception.landmarks import color_model, landmark_detector
from omnisim.perception.localization.filter import LandmarkMap, read_parameters
from omnisim.perception.localization.track import localize as localize_run
from omnisim.perception.localization.track import observation_from_detection
from omnisim.runs.run_data import RunData, SingleImage, read_run, read_single_image, train_on_run
from omnisim.scene.model import Landmark

SHOWN, REPORTED = 6, 4  # maximum number of panoramas in the figure, and in the report
LISTED = 8  # maximum number of steps in a note


def train(request: TrainRequest) -> None:
    """Learn colors from a run, write the model and print its rates."""
    check_suffix(request.output, color_model.MODEL_SUFFIX)
    check_target(request.output)
    run = read_run(request.run, request.scene, request.camera_name)
    costs = color_model.Costs(request.missed, request.false_alarm)
    trained = train_on_run(run, costs, lambda steps: track(steps, "learning", run.steps))
    for notice in run.notices:
        print_note(notice)
    color_model.save_model(request.output, trained.model, run.landmarks)
    colors, images = len(trained.model.colors), pluralize(trained.images, "image")
    out.print(f"{request.output}: {colors} colors from {images}")
    model = trained.model
    rows = zip(model.colors, model.thresholds, trained.curves, model.counts[1:], strict=True)
    for name, theta, curve, counts in rows:
        chosen = int(np.searchsorted(-curve.thresholds, -theta, side="right")) - 1
        hits = curve.true_positives[chosen] if chosen >= 0 else 0.0
        alarms = curve.false_positives[chosen] if chosen >= 0 else 0.0
        out.print(
            f"  {name}: {int(counts.sum())} pixels, Θ = {theta:.4g}: true positives "
            f"{100.0 * hits:.1f} %, false positives {100.0 * alarms:.2g} %; area under ROC "
            f"{curve.area:.4f}"
        )


def detect(request: DetectRequest) -> None:
    """Detect landmarks, write and plot them, and print their count."""
    if request.output is not None:
        check_suffix(request.output, landmark_detector.DETECTIONS_SUFFIX)
        check_target(request.output)
    if request.show is not None:
        require_extra("plots", "--show")
        from omnisim.plots.style import check_plot_target

        check_plot_target(request.show)
    model, landmarks = color_model.load_model(request.model)
    is_run = request.source.is_dir()
    expected = "expected an image, got the run" if is_run else "expected a run, got the image"
    others = ("height_m", "sensor") if is_run else ("scene", "camera_name")
    refuse_given(request, f"{expected} {request.source}", *others, error=OpticsError)
    source: RunData | SingleImage
    if is_run:
        source = read_run(request.source, request.scene, request.camera_name)
    else:
        sensor = None if request.sensor is None else read_sensor(request.sensor)
        source = read_single_image(request.source, request.height_m, sensor)
    detector = _detector(f"{request.model} for {request.source}", model, landmarks, source)
    shown = np.linspace(0, source.steps - 1, min(source.steps, SHOWN)).round().astype(int).tolist()
    detections: list[tuple[int, landmark_detector.Detection]] = []
    rows, empty = [], []
    for step in track(range(source.steps), "detecting"):
        panorama = detector.panorama(source.image(step))
        step_detections = detector.find(panorama)
        detections += [(step, detection) for detection in step_detections]
        if not step_detections:
            empty.append(step)
        if step in shown and request.show is not None:
            title = f"step {step}" if is_run else request.source.name
            title += f": {pluralize(len(step_detections), 'landmark')}"
            rows.append((title, panorama, step_detections))
    if request.output is not None:
        landmark_detector.write_detections(request.output, detections)
    if request.show is not None:
        from omnisim.plots.localization_plots import detections_figure
        from omnisim.plots.style import write_plot

        write_plot(request.show, detections_figure(rows))
    out.print(
        f"{request.output or request.show or request.source}: "
        f"{pluralize(len(detections), 'landmark')} in {pluralize(source.steps, 'image')}"
    )
    if not is_run:
        for _, detection in detections:
            bearing_deg = np.degrees((detection.bearing_rad, detection.bearing_sigma_rad))
            range_m = f"{detection.range_m:.3f} ± {detection.range_sigma_m:.3f} m"
            bearing = f"{bearing_deg[0]:z.2f} ± {bearing_deg[1]:.2f}°"
            out.print(f"  {detection.landmark}: {range_m}, {bearing}")
    for notice in source.notices:
        print_note(notice)
    if detector.ignored:
        print_note(_ignored(detector))
    if empty and is_run:
        steps = ", ".join(map(str, empty[:LISTED])) + (", ..." if len(empty) > LISTED else "")
        print_note(f"no landmark in {pluralize(len(empty), 'image')}: {steps}")


def _detector(
    what: str,
    model: color_model.ColorModel,
    landmarks: Sequence[Landmark],
    source: RunData | SingleImage,
) -> landmark_detector.LandmarkDetector:
    """Detector in the images of a run, or in one image; errors name what it is for."""
    try:
        return landmark_detector.LandmarkDetector(model, landmarks, source.mount)
    except LocalizationError as reason:
        raise LocalizationError(f"{what}: {reason}") from None


def _ignored(detector: landmark_detector.LandmarkDetector) -> str:
    return f"{', '.join(detector.ignored)}: not detected: the model lacks their colors"


def localize(request: LocalizeRequest) -> None:
    """Localize a run, write the estimate with its report, and print its errors."""
    from omnisim.report.localization_report import write_localized
    from omnisim.report.report import HTML, check_report_target

    check_report_target(request.output)
    chosen = read_parameters(request.params)
    data = read_run(request.run, request.scene, request.camera_name)
    notices = data.notices
    if request.model is None:
        own = "colors were learned from this run's own labels, which a real robot would not have"
        notices.append(own)
        colors = train_on_run(data, color_model.Costs()).model
    elif request.model.is_dir():
        expected = "expected an .npz file of landmarks train"
        raise LocalizationError(f"--model: {expected}, got the folder {request.model}")
    else:
        colors, _ = color_model.load_model(request.model)
    what = f"{request.model or request.run} for {request.run}"
    detector = _detector(what, colors, data.landmarks, data)
    at = set(np.linspace(0, data.steps - 1, min(REPORTED, data.steps)).round().astype(int).tolist())
    detections, shown = [], []
    for step in track(range(data.steps), "detecting"):
        panorama = detector.panorama(data.image(step))
        detections.append(detector.find(panorama))
        if step in at:
            title = f"step {step}: {pluralize(len(detections[-1]), 'landmark')}"
            shown.append((title, panorama, detections[-1]))
    if detector.ignored:
        notices.append(_ignored(detector))
    observations = [
        [observation_from_detection(each, chosen.measurement) for each in step_detections]
        for step_detections in detections
    ]
    landmarks, position_m = LandmarkMap.of_scene(data.landmarks), data.mount.position_m
    estimate = localize_run(data.odometry, observations, landmarks, chosen, position_m)
    report = write_localized(request.output, data, estimate, chosen, detections, shown, notices)
    (section,) = report.sections
    for notice in section.notices:
        print_note(notice)
    out.print(f"{request.output / HTML}: {pluralize(data.steps, 'step')}")
    for measure in section.measures:
        out.print(f"  {measure.name}: {measure.value_text}")
