"""Recording of drives: settings from the command line, progress bar, interruption, summary."""

from __future__ import annotations

from pathlib import Path

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

from omnisim.apps.cli.console import err, out, pluralize
from omnisim.apps.cli.images.requests import RenderRequest
from omnisim.apps.cli.inputs import (
    checked_backend,
    load_labeled_scene,
    note_lighting,
    parse_channel_format,
    parse_exposure,
    parse_polygons,
    read_preset,
)
from omnisim.apps.cli.option_groups import MeshImageOptions
from omnisim.apps.cli.runs.requests import DriveRequest
from omnisim.ground_truth import parse_channels
from omnisim.robots.vehicle import Vehicle
from omnisim.runs.drive import Drive, PlannedDrive
from omnisim.runs.route import Route


class RateColumn(ProgressColumn):
    """Column of a progress bar with a rate in units per second."""

    def __init__(self, unit: str):
        super().__init__()
        self._unit = unit

    def render(self, task: Task) -> Text:
        """Format the rate of a task."""
        return Text(f"{task.speed:.1f} {self._unit}/s" if task.speed else "", style="cyan")


def drive_of(request: DriveRequest | RenderRequest, vehicle: Vehicle, route: Route) -> Drive:
    """Drive of a vehicle, with the scene and the settings of a request.

    Raises:
        OmnisimError: names the option or the file.
    """
    world, light, truth = request.world, request.light, request.truth
    channels = () if truth.also is None else parse_channels(truth.also)
    scene, backend = load_labeled_scene(world, light, truth, channels), checked_backend(request.gpu)
    if vehicle.cameras and not light.unlit:
        sensors = [one.sensor for one in vehicle.cameras]
        note_lighting(world.scene, scene, backend, sensors)
    return Drive(
        scene,
        as_requested(vehicle, request.image),
        route,
        seed=request.seed if isinstance(request, DriveRequest) else request.motion.seed,
        unlit=light.unlit,
        device=request.gpu.device,
        backend=backend,
        up_axis=world.up_axis,
        meters_per_unit=world.meters_per_unit,
        resources=tuple(world.resources or ()),
        channels=channels,
        boxes_3d=truth.boxes_3d,
        channel_format=parse_channel_format(truth.channel_format, channels),
    )


def as_requested(vehicle: Vehicle, image: MeshImageOptions) -> Vehicle:
    """Vehicle with the options' settings in all its cameras."""
    return vehicle.with_cameras(
        size_px=image.size_px,
        polygons="same" if image.polygons is None else parse_polygons(image.polygons),
        degradation=read_preset(image.preset),
        exposure=parse_exposure(image.exposure_ev),
        quality=image.quality,
    )


def record(plan: PlannedDrive, folder: Path, force: bool) -> None:
    """Record a run, or resume an unfinished one, and print a summary."""
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(bar_width=32),
        MofNCompleteColumn(),
        RateColumn("steps"),
        TimeRemainingColumn(),
    )
    title = f"{plan.drive.vehicle.name} in {plan.drive.scene.name}"
    done, total = 0, len(plan.truth)
    console, is_hidden = err.console, not err.is_terminal
    with Progress(*columns, console=console, transient=True, disable=is_hidden) as progress:
        steps = plan.record(folder, force)
        try:
            before = done = next(steps)
            task = progress.add_task(title, total=total)
            progress.update(task, completed=before)
            for done in steps:
                progress.update(task, completed=done)
        except KeyboardInterrupt:
            command = "the same command without --force" if force else "the same command"
            if done:
                steps_done = f"{done} of {total} steps are done"
                err.print(f"{folder}: {steps_done}: {command} resumes the run", markup=False)
            raise
    objects = len(plan.contacts or ())
    touched = f"; contact with {pluralize(objects, 'object')}" if objects else ""
    summaries = ((one.name, one.sensor.mesh_summary) for one in plan.drive.vehicle.cameras)
    meshes = "".join(f"; {name}: {mesh}" for name, mesh in summaries if mesh != "exact")
    resumed = f", {before} of them there before" if before else ""
    out.print(
        f"{folder}: {pluralize(done, 'step')}{resumed}; "
        f"{plan.truth.path_length_m:.2f} m in {plan.truth.duration_s:.1f} s{meshes}{touched}",
        markup=False,
    )
