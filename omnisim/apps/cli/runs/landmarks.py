"""`omnisim landmarks`."""

from __future__ import annotations

import numpy as np

from omnisim.apps.cli.console import out, pluralize, print_note, track
from omnisim.apps.cli.inputs import read_sensor
from omnisim.apps.cli.runs.requests import DetectRequest, TrainRequest
from omnisim.core.errors import LocalizationError, OpticsError
from omnisim.core.extras import require_extra
from omnisim.core.files.atomic_file import check_suffix, check_target
from omnisim.perception.landmarks.color_model import (
    MODEL_SUFFIX,
    Costs,
    Training,
    load_model,
    save_model,
)
from omnisim.perception.landmarks.landmark_detector import (
    DETECTIONS_SUFFIX,
    Detection,
    LandmarkDetector,
    write_detections,
)
from omnisim.runs.run_data import RunData, read_run
from omnisim.runs.run_labels import train_on_run
from omnisim.runs.single_image import SingleImage, read_single_image

MAX_COST = 1e9  # beyond any sensible cost, and far below the limit of floats
SHOWN = 6  # maximum number of panoramas in the figure
LISTED = 8  # maximum number of steps in a note


def train(request: TrainRequest) -> None:
    """Learn colors from a run, write the model and print its rates."""
    for option, cost in (("--missed", request.missed), ("--false-alarm", request.false_alarm)):
        if not 1.0 / MAX_COST <= cost <= MAX_COST:
            raise LocalizationError(
                f"{option}: expected a number from {1.0 / MAX_COST:g} to {MAX_COST:g}, got {cost:g}"
            )
    check_suffix(request.output, MODEL_SUFFIX)
    check_target(request.output)
    run = read_run(request.run, request.scene, request.camera_name)
    trained = train_on_run(
        run,
        Costs(request.missed, request.false_alarm),
        lambda steps: track(steps, "learning", run.steps),
    )
    for notice in run.notices:
        print_note(notice)
    save_model(request.output, trained.model, run.landmarks)
    colors, images = len(trained.model.colors), pluralize(trained.images, "image")
    out.print(f"{request.output}: {colors} colors from {images}", markup=False)
    for line in _color_lines(trained):
        out.print(line, markup=False)


def _color_lines(trained: Training) -> list[str]:
    """Summary lines with the pixels, threshold and rates of each color."""
    model, lines = trained.model, []
    for name, theta, curve, counts in zip(
        model.colors, model.thresholds, trained.curves, model.counts[1:], strict=True
    ):
        chosen = int(np.searchsorted(-curve.thresholds, -theta, side="right")) - 1
        hits = curve.true_positives[chosen] if chosen >= 0 else 0.0
        alarms = curve.false_positives[chosen] if chosen >= 0 else 0.0
        lines.append(
            f"  {name}: {int(counts.sum())} pixels, Θ = {theta:.4g}: finds {100.0 * hits:.1f} % of "
            f"its pixels and {100.0 * alarms:.2g} % of others; area under ROC {curve.area:.4f}"
        )
    return lines


def detect(request: DetectRequest) -> None:
    """Detect landmarks, write and plot them, and print their count."""
    if request.output is not None:
        check_suffix(request.output, DETECTIONS_SUFFIX)
        check_target(request.output)
    if request.show is not None:
        require_extra("plots", "--show")
        from omnisim.plots.plot_file import check_plot_target

        check_plot_target(request.show)
    model, landmarks = load_model(request.model)
    is_run = request.source.is_dir()
    source = _open_run(request) if is_run else _open_image(request)
    try:
        detector = LandmarkDetector(model, landmarks, source.mount)
    except LocalizationError as reason:
        raise LocalizationError(f"{request.model} for {request.source}: {reason}") from None
    shown = np.linspace(0, source.steps - 1, min(source.steps, SHOWN)).round().astype(int).tolist()
    detections: list[tuple[int, Detection]] = []
    rows, empty = [], []
    for step in track(range(source.steps), "detecting", source.steps):
        panorama = detector.panorama(source.image(step))
        step_detections = detector.find(panorama)
        detections += [(step, detection) for detection in step_detections]
        if not step_detections:
            empty.append(step)
        if step in shown and request.show is not None:
            title = f"step {step}" if is_run else request.source.name
            rows.append(
                (
                    f"{title}: {pluralize(len(step_detections), 'landmark')}",
                    panorama,
                    step_detections,
                )
            )
    if request.output is not None:
        write_detections(request.output, detections)
    if request.show is not None:
        from omnisim.plots.detection_plots import detections_figure
        from omnisim.plots.plot_file import write_plot

        write_plot(request.show, detections_figure(rows))
    out.print(
        f"{request.output or request.show or request.source}: "
        f"{pluralize(len(detections), 'landmark')} in {pluralize(source.steps, 'image')}",
        markup=False,
    )
    if not is_run:
        for _, detection in detections:
            out.print(f"  {_measurement(detection)}", markup=False)
    for notice in source.notices:
        print_note(notice)
    if detector.ignored:
        print_note(f"{', '.join(detector.ignored)}: not detected: the model lacks their colors")
    if empty and is_run:
        steps = ", ".join(map(str, empty[:LISTED])) + (", ..." if len(empty) > LISTED else "")
        print_note(f"no landmark in {pluralize(len(empty), 'image')}: {steps}")


def _open_run(request: DetectRequest) -> RunData:
    for option, value in (("--height", request.height_m), ("--sensor", request.sensor)):
        if value is not None:
            raise OpticsError(f"{option}: expected an image, got the run {request.source}")
    return read_run(request.source, request.scene, request.camera_name)


def _open_image(request: DetectRequest) -> SingleImage:
    for option, value in (("--scene", request.scene), ("--camera-name", request.camera_name)):
        if value is not None:
            raise OpticsError(f"{option}: expected a run, got the image {request.source}")
    sensor = None if request.sensor is None else read_sensor(request.sensor)
    return read_single_image(request.source, request.height_m, sensor)


def _measurement(detection: Detection) -> str:
    return (
        f"{detection.landmark}: {detection.range_m:.3f} ± {detection.range_sigma_m:.3f} m, "
        f"{np.degrees(detection.bearing_rad):z.2f} ± "
        f"{np.degrees(detection.bearing_sigma_rad):.2f}°"
    )
