"""`omnisim plot`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.apps.cli.console import out, pluralize, print_note
from omnisim.apps.cli.runs.requests import PlotRequest
from omnisim.core.errors import SceneError
from omnisim.core.files.image_files import read_image
from omnisim.core.trajectories import Trajectory, read_trajectory
from omnisim.plots.plot_file import check_plot_target, write_plot
from omnisim.plots.run_plot import RunDrawing, run_figure, steps_to_show
from omnisim.robots import read_odometry
from omnisim.runs.drive import scene_contents
from omnisim.runs.run_folder import GROUND_TRUTH, OBJECTS, ODOMETRY, PLOT, RunFolder
from omnisim.scene import Scene


def run(request: PlotRequest) -> None:
    """Plot a run from above, or the runs of robots that drove together."""
    target = request.output or request.run / PLOT
    runs = RunFolder.read_each(request.run)
    check_plot_target(target)
    drawings, titles, steps = [], [], []
    for recorded in runs:
        name = recorded.path.name if len(runs) > 1 else ""
        drawing = _drawing(recorded, name)
        done = recorded.steps_done()
        title = _title(recorded, drawing.truth, drawing.reckoned, done)
        drawings.append(drawing)
        titles.append(f"{name}: {title}" if name else title)
        steps.append(f"{done} of {pluralize(len(drawing.truth), 'step')}")
    files = (file for one in runs for file in sorted((one.path / OBJECTS).glob("*.tum")))
    others = {file.stem: read_trajectory(file) for file in files}
    for drawing in drawings:
        others.pop(drawing.name, None)
    scene = _scene(runs[0], request.scene)
    write_plot(target, run_figure("\n".join(titles), scene, drawings, others))
    out.print(f"{target}: {', '.join(steps)}")


def _drawing(run: RunFolder, name: str) -> RunDrawing:
    """Drawing of a run: its paths, and the images of its first camera."""
    truth = read_trajectory(run.path / GROUND_TRUTH)
    run.check_steps(GROUND_TRUTH, len(truth))
    reckoned = _dead_reckoned(run)
    if notice := run.unfinished():
        print_note(notice)
    images = {}
    if run.manifest.cameras:
        camera, done = run.camera(), run.steps_done()
        shown = [step for step in steps_to_show(len(truth)) if step < done]
        files = {step: run.file(camera, run.index_at(camera, step), ".png") for step in shown}
        images = {step: read_image(file)[0] for step, file in files.items()}
    return RunDrawing(truth, reckoned, images, name)


def _dead_reckoned(run: RunFolder) -> NDArray[np.float64] | None:
    """Dead-reckoned positions (n, 2) from the wheels; None for a rig, which has no wheels."""
    if run.manifest.is_rig:
        return None
    positions_m = read_odometry(run.path / ODOMETRY).dead_reckoned().positions_m[:, :2]
    run.check_steps(ODOMETRY, len(positions_m))
    return positions_m


def _title(
    run: RunFolder, truth: Trajectory, reckoned: NDArray[np.float64] | None, done: int
) -> str:
    length_m = truth.path_length_m
    progress = "" if done == len(truth) else f" ({done} are there)"
    title = f"{run.manifest.title}: {length_m:.2f} m, {pluralize(len(truth), 'step')}{progress}"
    if reckoned is None:
        return title
    error_m = float(np.linalg.norm(truth.positions_m[-1, :2] - reckoned[-1]))
    share = f" ({100.0 * error_m / length_m:.1f} %)" if length_m > 0.0 else ""
    return f"{title}; odometry ends {error_m:.2f} m off{share}"


def _scene(run: RunFolder, scene: str | None) -> Scene | None:
    """Load the run's scene; if it is missing, print a note and return None."""
    recorded = run.manifest.scene
    try:
        loaded = recorded.load(scene)
    except SceneError as reason:
        if scene is not None:
            raise
        print_note(f"drawn without a map: {reason}; pass --scene FILE")
        return None
    if scene_contents(loaded) != recorded.contents:
        print_note(f"{loaded.name}: has changed since the run")
    return loaded
