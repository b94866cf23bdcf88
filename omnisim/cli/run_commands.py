"""Commands that make a run, and those that look at one."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from omnisim.cli.arguments import (
    AlsoOption,
    DeviceOption,
    LabelsOption,
    PolygonsOption,
    PresetOption,
    QualityOption,
    RunArgument,
    SceneArgument,
    SizeOption,
    UnlitOption,
    UpOption,
)
from omnisim.cli.consoles import err, out
from omnisim.cli.landmarks import CameraOption, SceneOption


def drive(
    scene: SceneArgument,
    robot: Annotated[
        str, typer.Option("--robot", help="A robot file, or the name of a built-in robot.")
    ],
    path: Annotated[
        str,
        typer.Option(
            "--path",
            help="A path of the scene, or a file: .tum .kitti .csv, or EuRoC's; a .csv of x_m and "
            "y_m alone has waypoints.",
        ),
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="Folder of the run; gone on with if it is there.")
    ],
    seed: Annotated[
        int, typer.Option("--seed", help="Of the odometry's and the cameras' noise.")
    ] = 0,
    step: Annotated[
        float, typer.Option("--step", metavar="M", help="Longest step along waypoints.")
    ] = 0.41,
    turn_step: Annotated[
        float, typer.Option("--turn-step", metavar="DEG", help="Longest step of a turn.")
    ] = 12.0,
    rate: Annotated[
        float | None,
        typer.Option(
            "--rate", metavar="HZ", help="Steps a second instead, or of a file without times."
        ),
    ] = None,
    ground: Annotated[
        float, typer.Option("--ground", metavar="M", help="Height of the ground of waypoints.")
    ] = 0.0,
    ignore_limits: Annotated[
        bool, typer.Option("--ignore-limits", help="Drive what the robot could not.")
    ] = False,
    polygons: PolygonsOption = None,
    size: SizeOption = None,
    quality: QualityOption = None,
    unlit: UnlitOption = False,
    also: AlsoOption = None,
    labels: LabelsOption = None,
    force: Annotated[
        bool, typer.Option("--force", help="Throw another run away that is in the folder.")
    ] = False,
    preset: PresetOption = None,
    up: UpOption = None,
    device: DeviceOption = None,
) -> None:
    """Drive a robot along a path and record pictures, scans, odometry and ground truth."""
    from omnisim.cli.drive import DriveRequest, run
    from omnisim.simulation.route import Route

    route = Route(path, step, turn_step, rate, ignore_limits, ground)
    request = DriveRequest(
        scene,
        robot,
        output,
        route,
        seed,
        polygons,
        size,
        unlit,
        force,
        up,
        device,
        also,
        labels,
        preset,
        quality,
    )
    run(request, out, err)


def localize(
    run_folder: RunArgument,
    output: Annotated[
        Path, typer.Option("-o", "--output", help="Folder for the estimate, figures and page.")
    ],
    model: Annotated[
        Path | None,
        typer.Option(
            "--model",
            metavar="FILE",
            help="Model of `landmarks train`. [dim]learned from the run's own labels[/]",
        ),
    ] = None,
    params: Annotated[
        Path | None,
        typer.Option("--params", metavar="FILE", help="Filter's parameters. [dim]omnisim's[/]"),
    ] = None,
    scene: SceneOption = None,
    camera: CameraOption = None,
) -> None:
    """Find out where the robot of a run was, from its wheels and the landmarks it saw."""
    from omnisim.cli.localize import run

    run(run_folder, output, model, params, scene, camera, out, err)


def plot(
    run_folder: RunArgument,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Plot: .png .pdf .svg. [dim]RUN/plot.png[/]"),
    ] = None,
    scene: Annotated[
        str | None, typer.Option("--scene", help="Its scene, where it is not where it was.")
    ] = None,
) -> None:
    """Draw a run from above: map, path, odometry, landmarks, pictures."""
    from omnisim.cli.run_views import plot as run

    run(run_folder, output, scene, out, err)


def video(
    run_folder: RunArgument,
    output: Annotated[Path, typer.Option("-o", "--output", help="Film: .mp4 or .mkv.")],
    camera: Annotated[
        str | None, typer.Option("--camera", help="Name of a camera. [dim]the first[/]")
    ] = None,
    fps: Annotated[float, typer.Option("--fps", help="Pictures a second.")] = 10.0,
) -> None:
    """Make a film of a run."""
    from omnisim.cli.run_views import video as run

    run(run_folder, output, camera, fps, out, err)
