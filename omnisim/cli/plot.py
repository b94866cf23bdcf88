"""`omnisim plot`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.cli.console import out, pluralize, print_note
from omnisim.cli.run_requests import PlotRequest
from omnisim.errors import SceneError
from omnisim.image_files import read_image
from omnisim.plots.plot_file import check_plot_target, write_plot
from omnisim.plots.run_plot import run_figure, steps_to_show
from omnisim.robot import read_odometry
from omnisim.scene import Scene
from omnisim.simulation.drive import scene_contents
from omnisim.simulation.run_folder import GROUND_TRUTH, OBJECTS, ODOMETRY, PLOT, RunFolder
from omnisim.trajectories import Trajectory, read_trajectory


def run(request: PlotRequest) -> None:
    """Plot a run from above."""
    folder = request.run
    target = request.output or folder / PLOT
    recorded = RunFolder.read(folder)
    check_plot_target(target)
    truth = read_trajectory(folder / GROUND_TRUTH)
    recorded.check_steps(GROUND_TRUTH, len(truth))
    reckoned = _dead_reckoned(recorded)
    done = recorded.steps_done()
    if notice := recorded.unfinished():
        print_note(notice)
    pictures = {}
    if recorded.manifest.cameras:
        camera = recorded.camera()
        shown = [step for step in steps_to_show(len(truth)) if step < done]
        pictures = {step: _image(recorded, camera, step) for step in shown}
    title = _title(recorded, truth, reckoned, done)
    scene, others = _scene(recorded, request.scene), _others(recorded)
    figure = run_figure(title, scene, truth, reckoned, pictures, others)
    write_plot(target, figure)
    out.print(f"{target}: {done} of {pluralize(len(truth), 'step')}", markup=False)


def _image(run: RunFolder, camera: str, step: int) -> NDArray[np.uint8]:
    """Last image (height, width, 3) of a camera at a step."""
    return read_image(run.file(camera, run.index_at(camera, step), ".png"))[0]


def _others(run: RunFolder) -> dict[str, Trajectory]:
    """Trajectories of other robots and of dynamic objects, by name."""
    return {file.stem: read_trajectory(file) for file in sorted((run.path / OBJECTS).glob("*.tum"))}


def _dead_reckoned(run: RunFolder) -> NDArray[np.float64] | None:
    """Positions (n, 2) by the wheels, or None: the run is of a rig, which has none."""
    if run.manifest.is_rig:
        return None
    positions_m = read_odometry(run.path / ODOMETRY).dead_reckoned().positions_m[:, :2]
    run.check_steps(ODOMETRY, len(positions_m))
    return positions_m


def _title(
    run: RunFolder, truth: Trajectory, reckoned: NDArray[np.float64] | None, done: int
) -> str:
    length_m = truth.path_length_m
    there = "" if done == len(truth) else f" ({done} are there)"
    title = f"{run.manifest.title}: {length_m:.2f} m, {pluralize(len(truth), 'step')}{there}"
    if reckoned is None:
        return title
    error_m = float(np.linalg.norm(truth.positions_m[-1, :2] - reckoned[-1]))
    share = f" ({100.0 * error_m / length_m:.1f} %)" if length_m > 0.0 else ""
    return f"{title}; odometry ends {error_m:.2f} m off{share}"


def _scene(run: RunFolder, scene: str | None) -> Scene | None:
    """Load the run's scene; None with a note where it is missing."""
    recorded = run.manifest.scene
    try:
        found = recorded.load(scene)
    except SceneError as reason:
        if scene is not None:
            raise
        print_note(f"drawn without a map: {reason}; pass --scene FILE")
        return None
    if scene_contents(found) != recorded.contents:
        print_note(f"{found.name}: is not as it was in the run")
    return found
