"""`omnisim landmarks detect`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from rich.console import Console

from omnisim.atomic_file import check_suffix, check_target
from omnisim.cli.options import counted, read_sensor
from omnisim.cli.progress import count_along
from omnisim.errors import LocalizationError, OpticsError
from omnisim.experiments.detecting import picture_source, run_source
from omnisim.perception.color_model_file import load_model
from omnisim.perception.detection_files import SUFFIX, write_detections
from omnisim.perception.landmark_detector import LandmarkDetector
from omnisim.plots.detection_plots import detections_figure
from omnisim.plots.plot_file import check_plot_target, write_plot


def run(
    source: Path,
    model_path: Path,
    output: Path | None,
    show: Path | None,
    height_m: float | None,
    scene: str | None,
    camera: str | None,
    sensor: Path | None,
    out: Console,
    err: Console,
) -> None:
    """Find landmarks; write them, draw them, and say how many there are.

    Raises:
        OmnisimError: anything that the user can put right.
    """
    if output is not None:
        check_suffix(output, SUFFIX)
        check_target(output)
    if show is not None:
        check_plot_target(show)
    model, landmarks = load_model(model_path)
    is_run = source.is_dir()
    for option, value in (("--height", height_m), ("--sensor", sensor)):
        if value is not None and is_run:
            raise OpticsError(f"{option} {value}: is for a picture; a run knows its camera")
    for option, given in (("--scene", scene), ("--camera", camera)):
        if given is not None and not is_run:
            raise OpticsError(f"{option} {given}: is for a run, and {source} is a picture")
    if is_run:
        told = run_source(source, scene, camera)
    else:
        by = None if sensor is None else read_sensor(sensor)
        told = picture_source(source, height_m, by)
    try:
        detector = LandmarkDetector(model, landmarks, told.mount)
    except LocalizationError as reason:
        raise LocalizationError(f"{model_path} for {source}: {reason}") from None
    shown = set(np.linspace(0, told.count - 1, min(told.count, 6)).round().astype(int).tolist())
    found, rows, empty = [], [], []
    for step in count_along(range(told.count), "looking", told.count, err):
        panorama = detector.panorama(told.picture(step))
        detections = detector.find(panorama)
        found += [(step, detection) for detection in detections]
        if not detections:
            empty.append(step)
        if step in shown and show is not None:
            title = f"step {step}" if is_run else source.name
            rows.append((f"{title}: {counted(len(detections), 'landmark')}", panorama, detections))
    if output is not None:
        write_detections(output, found)
    if show is not None:
        write_plot(show, detections_figure(rows))
    where = output or show or source
    out.print(
        f"{where}: {counted(len(found), 'landmark')} in {counted(told.count, 'picture')}",
        markup=False,
    )
    if not is_run:
        for _, detection in found:
            out.print(
                f"  {detection.landmark}: {detection.range_m:.3f} ± {detection.range_sigma_m:.3f} m"
                f", {np.degrees(detection.bearing_rad):.2f} ± "
                f"{np.degrees(detection.bearing_sigma_rad):.2f}°",
                markup=False,
            )
    if told.unfinished:
        err.print("note: ", told.unfinished, sep="", markup=False)
    if detector.ignored:
        names = ", ".join(detector.ignored)
        err.print(f"note: {names}: not looked for: not told by the model's colours", markup=False)
    if empty and is_run:
        names = ", ".join(map(str, empty[:8])) + (", ..." if len(empty) > 8 else "")
        err.print(f"note: no landmark in {counted(len(empty), 'picture')}: {names}", markup=False)
