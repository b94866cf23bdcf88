"""`omnisim localize`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from omnisim.apps.cli.console import out, pluralize, print_note, track
from omnisim.apps.cli.runs.requests import LocalizeRequest
from omnisim.core.errors import LocalizationError
from omnisim.perception.landmarks.color_model import ColorModel, Costs, load_model
from omnisim.perception.landmarks.landmark_detector import LandmarkDetector
from omnisim.perception.localization.filter import LandmarkMap
from omnisim.perception.localization.filter_parameters import read_parameters
from omnisim.perception.localization.localize import localize, observation_from_detection
from omnisim.report.localization_report import write_localized
from omnisim.report.report import HTML, check_report_target
from omnisim.runs.run_data import read_run
from omnisim.runs.run_labels import train_on_run

SHOWN = 4  # maximum number of panoramas in the report


def run(request: LocalizeRequest) -> None:
    """Localize a run, write the estimate with its report, and print its errors."""
    check_report_target(request.output)
    chosen = read_parameters(request.params)
    data = read_run(request.run, request.scene, request.camera_name)
    colors = _read_colors(request.model)
    notices = data.notices
    if colors is None:
        notices.append("colors were learned from this run's own labels, which no robot has")
        colors = train_on_run(data, Costs()).model
    try:
        detector = LandmarkDetector(colors, data.landmarks, data.mount)
    except LocalizationError as reason:
        model = request.model or request.run
        raise LocalizationError(f"{model} for {request.run}: {reason}") from None
    at = set(np.linspace(0, data.steps - 1, min(SHOWN, data.steps)).round().astype(int).tolist())
    detections, shown = [], []
    for step in track(range(data.steps), "detecting", data.steps):
        panorama = detector.panorama(data.image(step))
        detections.append(detector.find(panorama))
        if step in at:
            title = f"step {step}: {pluralize(len(detections[-1]), 'landmark')}"
            shown.append((title, panorama, detections[-1]))
    if detector.ignored:
        notices.append(f"{', '.join(detector.ignored)}: not detected: the model lacks their colors")
    observations = [
        [observation_from_detection(each, chosen.measurement) for each in step_detections]
        for step_detections in detections
    ]
    estimate = localize(
        data.odometry,
        observations,
        LandmarkMap.of_scene(data.landmarks),
        chosen,
        data.mount.position_m,
    )
    report = write_localized(request.output, data, estimate, chosen, detections, shown, notices)
    (section,) = report.sections
    for notice in section.notices:
        print_note(notice)
    out.print(f"{request.output / HTML}: {pluralize(data.steps, 'step')}", markup=False)
    for measure in section.measures:
        out.print(f"  {measure.name}: {measure.value_text}", markup=False)


def _read_colors(path: Path | None) -> ColorModel | None:
    """Read a color model; None: it will be learned from the run itself."""
    if path is None:
        return None
    if path.is_dir():
        raise LocalizationError(
            f"--model: expected an .npz file of landmarks train, got the folder {path}"
        )
    model, _ = load_model(path)
    return model
