"""`omnisim plot` and `omnisim video`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.cli.console import out, pluralize, print_note, track
from omnisim.cli.run_requests import PlotRequest, VideoRequest
from omnisim.errors import OutputError, RunError, SceneError
from omnisim.image_files import read_image
from omnisim.plots.plot_file import check_plot_target, write_plot
from omnisim.plots.run_plot import run_figure, steps_to_show
from omnisim.plots.video_file import check_video_target, write_video
from omnisim.robot import Trajectory, read_odometry, read_trajectory
from omnisim.scene import Scene, load_scene
from omnisim.simulation.drive import scene_contents
from omnisim.simulation.run_folder import GROUND_TRUTH, ODOMETRY, PLOT, RunFolder


def plot(request: PlotRequest) -> None:
    """Plot a run from above."""
    folder = request.run
    target = request.output or folder / PLOT
    run = RunFolder.read(folder)
    check_plot_target(target)
    truth = read_trajectory(folder / GROUND_TRUTH)
    reckoned = read_odometry(folder / ODOMETRY).dead_reckoned().positions_m[:, :2]
    for name, count in ((GROUND_TRUTH, len(truth)), (ODOMETRY, len(reckoned))):
        run.check_steps(name, count)
    done = run.steps_done()
    pictures = {}
    if run.manifest.cameras:
        camera = run.camera()
        shown = [step for step in steps_to_show(len(truth)) if step < done]
        pictures = {step: _picture(run.file(camera, step, ".png")) for step in shown}
    title = _title(
        run, truth, float(np.linalg.norm(truth.positions_m[-1, :2] - reckoned[-1])), done
    )
    figure = run_figure(title, _scene(run, request.scene), truth, reckoned, pictures)
    write_plot(target, figure)
    out.print(f"{target}: {done} of {pluralize(len(truth), 'step')}", markup=False)


def video(request: VideoRequest) -> None:
    """Encode a camera's pictures as a video."""
    folder, output, rate_hz = request.run, request.output, request.rate_hz
    if not 0.1 <= rate_hz <= 240.0:
        raise OutputError(f"--fps: expected 0.1 to 240 frames per second, got {rate_hz:g}")
    run = RunFolder.read(folder)
    check_video_target(output)
    name = run.camera(request.camera)
    done = run.steps_done()
    if done == 0:
        raise RunError(f"{folder}: has no pictures yet: run drive again to go on")

    def pictures() -> Iterator[NDArray[Any]]:
        for step in track(range(done), "encoding", done):
            yield _picture(run.file(name, step, ".png"))

    count = write_video(output, pictures(), rate_hz)
    out.print(f"{output}: {pluralize(count, 'picture')}, {count / rate_hz:.1f} s", markup=False)


def _title(run: RunFolder, truth: Trajectory, error_m: float, done: int) -> str:
    length_m = truth.path_length_m
    there = "" if done == len(truth) else f" ({done} are there)"
    share = f" ({100.0 * error_m / length_m:.1f} %)" if length_m > 0.0 else ""
    return (
        f"{run.manifest.title}: {length_m:.2f} m, {pluralize(len(truth), 'step')}{there}; "
        f"odometry ends {error_m:.2f} m off{share}"
    )


def _scene(run: RunFolder, scene: str | None) -> Scene | None:
    """Load the run's scene; None with a note where it is missing."""
    recorded = run.manifest.scene
    try:
        found = load_scene(scene or recorded.file, recorded.up_axis)
    except SceneError as reason:
        if scene is not None:
            raise
        print_note(f"drawn without a map: {reason}; pass --scene FILE")
        return None
    if scene_contents(found) != recorded.contents:
        print_note(f"{found.name}: is not as it was in the run")
    return found


def _picture(path: Path) -> NDArray[Any]:
    pixels, _ = read_image(path)
    return pixels
