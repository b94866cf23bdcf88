"""`omnisim plot` and `omnisim video`: what a run looks like."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from omnisim.apps.cli.console import out, pluralize, print_note, track
from omnisim.apps.cli.runs.requests import PlotRequest, VideoRequest
from omnisim.core.arrays import Bytes, Floats
from omnisim.core.errors import RunError, SceneError
from omnisim.core.files.image_files import read_image
from omnisim.core.trajectories import read_trajectory
from omnisim.robots import read_odometry
from omnisim.runs.drive import scene_contents
from omnisim.runs.run_folder import GROUND_TRUTH, OBJECTS, ODOMETRY, PLOT, RunFolder
from omnisim.scene import Scene


def plot(request: PlotRequest) -> None:
    """Plot a run from above, or the runs of robots that drove together."""
    from omnisim.plots.run_plot import RunDrawing, run_figure, steps_to_show
    from omnisim.plots.style import check_plot_target, write_plot

    target = request.output or request.run / PLOT
    runs = RunFolder.read_each(request.run)
    check_plot_target(target)
    drawings, titles, steps = [], [], []
    for recorded in runs:
        name, done = recorded.path.name if len(runs) > 1 else "", recorded.steps_done()
        truth = read_trajectory(recorded.path / GROUND_TRUTH)
        recorded.check_steps(GROUND_TRUTH, len(truth))
        reckoned = None
        if not recorded.manifest.is_rig:  # which has no wheels
            odometry = read_odometry(recorded.path / ODOMETRY)
            reckoned = odometry.dead_reckoned().positions_m[:, :2]
            recorded.check_steps(ODOMETRY, len(reckoned))
        if notice := recorded.unfinished():
            print_note(notice)
        images = {}
        if recorded.manifest.cameras:
            camera = recorded.camera()
            for step in (step for step in steps_to_show(len(truth)) if step < done):
                file = recorded.file(camera, recorded.index_at(camera, step), ".png")
                images[step] = read_image(file)[0]
        drawings.append(RunDrawing(truth, reckoned, images, name))
        length_m = truth.path_length_m
        progress = "" if done == len(truth) else f" ({done} recorded)"
        count = f"{pluralize(len(truth), 'step')}{progress}"
        title = f"{recorded.manifest.title}: {length_m:.2f} m, {count}"
        if reckoned is not None:
            error_m = float(np.linalg.norm(truth.positions_m[-1, :2] - reckoned[-1]))
            share = f" ({100.0 * error_m / length_m:.1f} %)" if length_m > 0.0 else ""
            title += f"; odometry ends {error_m:.2f} m off{share}"
        titles.append(f"{name}: {title}" if name else title)
        steps.append(f"{done} of {pluralize(len(truth), 'step')}")
    files = (file for run in runs for file in sorted((run.path / OBJECTS).glob("*.tum")))
    others = {file.stem: read_trajectory(file) for file in files}
    for drawing in drawings:
        others.pop(drawing.name, None)
    scene = _scene(runs[0], request.scene)
    write_plot(target, run_figure("\n".join(titles), scene, drawings, others))
    out.print(f"{target}: {', '.join(steps)}")


def _scene(run: RunFolder, scene: str | None) -> Scene | None:
    """Load the run's scene; if it is missing, print a note and return None."""
    recorded = run.manifest.scene
    try:
        loaded = recorded.load(scene)
    except SceneError as reason:
        if scene is not None:
            raise
        print_note(f"plotted without a map: {reason}; pass --scene FILE")
        return None
    if scene_contents(loaded) != recorded.contents:
        print_note(f"{loaded.name}: has changed since the run")
    return loaded


def video(request: VideoRequest) -> None:
    """Encode a camera's images as a video; robots that drove together appear side by side."""
    from omnisim.plots.video_file import check_video_target, write_video

    folder, output, rate_hz = request.run, request.output, request.rate_hz
    runs = RunFolder.read_each(folder)
    check_video_target(output)
    for recorded in runs:
        if recorded.measurements_done(recorded.camera(request.camera_name)) == 0:
            remedy = "run its command again to resume it"
            raise RunError(f"{recorded.path}: has no images yet: {remedy}")
        if notice := recorded.unfinished():
            print_note(notice)
    cameras = [(recorded, recorded.camera(request.camera_name)) for recorded in runs]
    views = [
        _View(run, name, run.times_s(name)[: run.measurements_done(name)]) for run, name in cameras
    ]
    longest = max(views, key=lambda view: len(view.times_s))
    times_s = longest.times_s.tolist()

    def images() -> Iterator[Bytes]:
        for time_s in track(times_s, "encoding"):
            yield side_by_side([view.at(time_s) for view in views])

    count = write_video(output, images(), rate_hz)
    out.print(f"{output}: {pluralize(count, 'image')}, {count / rate_hz:.1f} s")


@dataclass(frozen=True, eq=False)
class _View:
    """Images of a camera of a run, recorded at times (n,)."""

    run: RunFolder
    camera: str
    times_s: Floats

    def at(self, time_s: float) -> Bytes:
        """Latest image (height, width, 3) at `time_s` seconds; the first one if none is earlier."""
        step = max(0, int(np.searchsorted(self.times_s, time_s, side="right")) - 1)
        return read_image(self.run.file(self.camera, step, ".png"))[0]


def side_by_side(images: Sequence[Bytes]) -> Bytes:
    """Join images (height, width, 3) horizontally, with black below the lower ones."""
    if len(images) == 1:
        return images[0]
    height = max(image.shape[0] for image in images)
    below = (((0, height - image.shape[0]), (0, 0), (0, 0)) for image in images)
    padded = (np.pad(image[..., :3], by) for image, by in zip(images, below, strict=True))
    return np.concatenate(list(padded), axis=1)
