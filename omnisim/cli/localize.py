"""`omnisim localize`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from rich.console import Console

from omnisim.cli.options import counted
from omnisim.cli.progress import count_along
from omnisim.errors import LocalizationError
from omnisim.experiments.localizing import localize, sighting_of
from omnisim.experiments.localizing_report import write_localized
from omnisim.experiments.run_data import read_run
from omnisim.experiments.training import train_on_run
from omnisim.localization.parameters import read_parameters
from omnisim.localization.sightings import LandmarkMap
from omnisim.perception.color_model import ColorModel, Costs
from omnisim.perception.color_model_file import load_model
from omnisim.perception.landmark_detector import LandmarkDetector
from omnisim.reports.report import HTML, check_report_target

SHOWN = 4  # panoramas on the page


def run(
    folder: Path,
    output: Path,
    model: Path | None,
    parameters: Path | None,
    scene: str | None,
    camera: str | None,
    out: Console,
    err: Console,
) -> None:
    """Localize a run, write the estimate and its page, and say how good it is.

    Raises:
        OmnisimError: anything that the user can put right.
    """
    check_report_target(output)
    chosen = read_parameters(parameters)
    data = read_run(folder, scene, camera)
    colors = _colors(model, folder)
    told = [] if data.unfinished is None else [data.unfinished]
    if colors is None:
        told.append("colours were learned from this run's own labels, which no robot has")
        colors = train_on_run(data, Costs()).model
    try:
        detector = LandmarkDetector(colors, data.landmarks, data.mount)
    except LocalizationError as reason:
        raise LocalizationError(f"{model or folder} for {folder}: {reason}") from None
    at = set(np.linspace(0, data.steps - 1, min(SHOWN, data.steps)).round().astype(int).tolist())
    detections, shown = [], []
    for step in count_along(range(data.steps), "looking", data.steps, err):
        panorama = detector.panorama(data.picture(step))
        detections.append(detector.find(panorama))
        if step in at:
            title = f"step {step}: {counted(len(detections[-1]), 'landmark')}"
            shown.append((title, panorama, detections[-1]))
    if detector.ignored:
        told.append(
            f"{', '.join(detector.ignored)}: not looked for: the model has not their colours"
        )
    sightings = [[sighting_of(each, chosen.measurement) for each in found] for found in detections]
    found = localize(
        data.odometry,
        sightings,
        LandmarkMap.of_scene(data.landmarks),
        chosen,
        data.mount.position_m,
    )
    report = write_localized(output, data, found, chosen, detections, shown, told)
    (section,) = report.sections
    for notice in section.notices:
        err.print("note: ", notice, sep="", markup=False)
    out.print(f"{output / HTML}: {counted(data.steps, 'step')}", markup=False)
    for measure in section.measures:
        out.print(f"  {measure.name}: {measure.value_text}", markup=False)


def _colors(path: Path | None, folder: Path) -> ColorModel | None:
    """The model of a file, or None: to be learned from the run itself."""
    if path is None:
        return None
    if path.is_dir():
        raise LocalizationError(f"{path}: is a folder: want the .npz file of landmarks train")
    model, _ = load_model(path)
    return model
