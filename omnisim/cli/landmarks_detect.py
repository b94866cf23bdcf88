"""`omnisim landmarks detect`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from rich.console import Console

from omnisim.atomic_file import check_target
from omnisim.cli.options import counted
from omnisim.cli.progress import count_along
from omnisim.errors import OpticsError
from omnisim.experiments.detecting import picture_source, run_source
from omnisim.perception.color_model_file import load_model
from omnisim.perception.detection_files import write_detections
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
    out: Console,
    err: Console,
) -> None:
    """Find landmarks; write them, draw them, and say how many there are.

    Raises:
        OmnisimError: anything that the user can put right.
    """
    if output is not None:
        check_target(output)
    if show is not None:
        check_plot_target(show)
    model, landmarks = load_model(model_path)
    is_run = source.is_dir()
    if is_run and height_m is not None:
        raise OpticsError("--height: is for a picture; a run says how high its camera is")
    told = run_source(source, scene, camera) if is_run else picture_source(source, height_m)
    detector = LandmarkDetector(model, landmarks, told.mount)
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
    if empty and is_run:
        names = ", ".join(map(str, empty[:8])) + (", ..." if len(empty) > 8 else "")
        err.print(f"note: no landmark in {counted(len(empty), 'picture')}: {names}", markup=False)
