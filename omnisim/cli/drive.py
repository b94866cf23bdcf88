"""`omnisim drive`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TextColumn,
    TimeRemainingColumn,
)
from rich.text import Text

from omnisim.cli.options import counted, load_labelled_scene, parse_polygons, read_preset
from omnisim.ground_truth import parse_channels
from omnisim.simulation.drive import Drive, with_cameras
from omnisim.simulation.route import Route
from omnisim.simulation.vehicle import Vehicle


@dataclass(frozen=True)
class DriveRequest:
    """The arguments of the command, as its help explains them."""

    scene: str
    robot: str
    output: Path
    route: Route
    seed: int
    polygons: str | None
    size_px: int | None
    unlit: bool
    force: bool
    up_axis: str | None
    device: int | None
    also: str | None = None
    labels: Path | None = None
    preset: str | None = None
    quality: str | None = None


class _Rate(ProgressColumn):
    """Steps a second."""

    def render(self, task: Task) -> Text:
        return Text(f"{task.speed:.1f} steps/s" if task.speed else "", style="cyan")


def run(request: DriveRequest, out: Console, err: Console) -> None:
    """Drive, and say where the run is; what is there already is kept.

    Raises:
        OmnisimError: anything that the user can put right.
    """
    channels = () if request.also is None else parse_channels(request.also)
    scene = load_labelled_scene(request.scene, request.up_axis, request.labels, channels, err)
    polygons = "same" if request.polygons is None else parse_polygons(request.polygons)
    vehicle = with_cameras(
        Vehicle.load(request.robot),
        request.size_px,
        polygons,
        read_preset(request.preset),
        request.quality,
    )
    drive = Drive(
        scene,
        vehicle,
        request.route,
        seed=request.seed,
        unlit=request.unlit,
        device=request.device,
        up_axis=request.up_axis,
        channels=channels,
    )
    plan = drive.plan()
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(bar_width=32),
        MofNCompleteColumn(),
        _Rate(),
        TimeRemainingColumn(),
    )
    done, total = 0, len(plan.truth)
    with Progress(*columns, console=err, transient=True, disable=not err.is_terminal) as progress:
        steps = plan.record(request.output, request.force)
        try:
            before = done = next(steps)
            task = progress.add_task(f"{vehicle.name} in {scene.name}", total=total)
            progress.update(task, completed=before)
            for done in steps:
                progress.update(task, completed=done)
        except KeyboardInterrupt:
            how = "the same command without --force" if request.force else "the same command"
            if done:
                err.print(
                    f"{request.output}: {done} of {total} steps are there: {how} goes on",
                    markup=False,
                )
            raise
    went_on = f", {before} of them there before" if before else ""
    out.print(
        f"{request.output}: {counted(done, 'step')}{went_on}; {plan.truth.path_length_m:.2f} m in "
        f"{plan.truth.duration_s:.1f} s",
        markup=False,
    )
