"""The command line: parse, call, print."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from omnisim import __version__
from omnisim.cli.arguments import (
    AlsoOption,
    AtOption,
    DeviceOption,
    LabelsOption,
    PictureOption,
    PolygonsOption,
    PresetOption,
    RunArgument,
    SceneArgument,
    SizeOption,
    UnlitOption,
    UpOption,
    YawOption,
)
from omnisim.cli.calibration import MirroredOption, NameOption, calibration_app
from omnisim.cli.choices import RangeMode, ViewKind
from omnisim.cli.consoles import err, out
from omnisim.cli.landmarks import CameraOption, SceneOption, landmarks_app
from omnisim.cli.robot import robot_app
from omnisim.errors import OmnisimError

INTERRUPTED = 130  # exit status after Ctrl-C, as shells have it

app = typer.Typer(
    name="omnisim",
    help="Pictures from omnidirectional cameras that can be trusted to a tenth of a pixel.",
    no_args_is_help=True,
    rich_markup_mode="rich",
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

app.add_typer(robot_app)
app.add_typer(landmarks_app)
app.add_typer(calibration_app)


def _print_version(wanted: bool) -> None:
    if wanted:
        out.print(f"omnisim {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Print it."),
    ] = False,
) -> None:
    """Pictures from omnidirectional cameras that can be trusted to a tenth of a pixel."""


@app.command()
def info() -> None:
    """Show what draws here, what is missing, and how to get it."""
    from omnisim.cli.info import run

    run(out)


@app.command()
def render(
    scene: SceneArgument,
    output: PictureOption,
    sensor: Annotated[
        Path | None, typer.Option("--sensor", help="Sensor file; by default the paper's camera.")
    ] = None,
    camera: Annotated[
        Path | None,
        typer.Option(
            "--camera",
            metavar="FILE",
            help="Calibration file instead: Kalibr, OpenCV, COLMAP, … "
            "(`omnisim calibration formats`).",
        ),
    ] = None,
    camera_name: NameOption = None,
    mirrored: MirroredOption = None,
    at: AtOption = None,
    yaw: YawOption = None,
    polygons: PolygonsOption = None,
    size: SizeOption = None,
    unlit: UnlitOption = False,
    faces: Annotated[
        Path | None,
        typer.Option(
            "--faces", metavar="DIR", help="Also write the virtual cameras' pictures here."
        ),
    ] = None,
    also: AlsoOption = None,
    labels: LabelsOption = None,
    next_at: Annotated[
        tuple[float, float, float] | None,
        typer.Option("--next", metavar="X Y Z", help="Where flow leads to. [dim]0.1 m ahead[/]"),
    ] = None,
    next_yaw: Annotated[
        float | None,
        typer.Option("--next-yaw", metavar="DEG", help="Heading there. [dim]as now[/]"),
    ] = None,
    preview: Annotated[
        bool, typer.Option("--preview", help="Also write a picture to look at of each channel.")
    ] = False,
    preset: PresetOption = None,
    seed: Annotated[int, typer.Option("--seed", metavar="N", help="Of the camera's noise.")] = 0,
    speed: Annotated[
        float,
        typer.Option("--speed", metavar="M/S", help="Forwards, for motion blur and the shutter."),
    ] = 0.0,
    turn_rate: Annotated[
        float, typer.Option("--turn-rate", metavar="DEG/S", help="To the left, for the same.")
    ] = 0.0,
    rays: Annotated[
        Path | None,
        typer.Option("--rays", metavar="FILE", help="Also write the ray of each pixel: .exr"),
    ] = None,
    calibration: Annotated[
        Path | None,
        typer.Option("--calibration", metavar="FILE", help="Also write camera and pose: .json"),
    ] = None,
    up: UpOption = None,
    device: DeviceOption = None,
) -> None:
    """Render one frame of an omnidirectional camera, and what is true of its pixels."""
    from omnisim.cli.render import RenderRequest, run

    request = RenderRequest(
        scene, output, sensor, camera, camera_name, mirrored, at, yaw, polygons, size, unlit,
        faces, up, device, also, labels, next_at, next_yaw, preview, preset, seed, speed,
        turn_rate, rays, calibration,
    )  # fmt: skip
    run(request, out, err)


@app.command()
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
    )
    run(request, out, err)


@app.command()
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


@app.command()
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


@app.command()
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


@app.command()
def unwarp(
    picture: Annotated[
        Path,
        typer.Argument(metavar="PICTURE", help="A picture that omnisim took, or any other."),
    ],
    to: Annotated[
        ViewKind,
        typer.Option("--to", help="The view: a panorama, a pinhole camera's, a map of the ground."),
    ],
    output: PictureOption,
    sensor: Annotated[
        Path | None,
        typer.Option("--sensor", help="Sensor file; by default what the picture says of itself."),
    ] = None,
    size: Annotated[
        tuple[int, int] | None,
        typer.Option("--size", metavar="W H", help="Pixels. [dim]as fine as the picture[/]"),
    ] = None,
    yaw: Annotated[
        float,
        typer.Option("--yaw", metavar="DEG", help="Heading, counter-clockwise from the front."),
    ] = 0.0,
    pitch: Annotated[
        float | None,
        typer.Option("--pitch", metavar="DEG", help="Perspective: downwards. [dim]0[/]"),
    ] = None,
    fov: Annotated[
        float | None,
        typer.Option(
            "--fov", metavar="DEG", help="Perspective: from left to right edge. [dim]90[/]"
        ),
    ] = None,
    elevation: Annotated[
        tuple[float, float] | None,
        typer.Option(
            "--elevation",
            metavar="LOW HIGH",
            help="Cylinder: rows, degrees above the horizon. [dim]-45 to the highest seen[/]",
        ),
    ] = None,
    height: Annotated[
        float | None,
        typer.Option(
            "--height",
            metavar="M",
            help="Bird's eye: height of the viewpoint over the ground. [dim]the picture's z[/]",
        ),
    ] = None,
    extent: Annotated[
        float | None,
        typer.Option(
            "--extent", metavar="M", help="Bird's eye: from middle to edge. [dim]4 × height[/]"
        ),
    ] = None,
) -> None:
    """Unwarp an omnidirectional picture to a cylinder, a perspective view or a map."""
    from omnisim.cli.unwarp import UnwarpRequest, run

    request = UnwarpRequest(
        picture, output, to, sensor, size, yaw, pitch, fov, elevation, height, extent
    )
    run(request, out)


@app.command()
def scan(
    scene: SceneArgument,
    output: Annotated[
        Path, typer.Option("-o", "--output", help="Ranges: .csv with beam, angle_deg, range_m.")
    ],
    plot: Annotated[
        Path | None,
        typer.Option("--plot", metavar="FILE", help="Also plot it from above: .png .pdf .svg"),
    ] = None,
    at: AtOption = None,
    yaw: YawOption = None,
    resolution: Annotated[
        float,
        typer.Option("--resolution", metavar="DEG", help="1 or 0.5 over 180°, or 0.25 over 100°."),
    ] = 0.5,
    mode: Annotated[
        RangeMode,
        typer.Option("--mode", help="To 8.19 m in steps of 1 mm, or to 81.9 m in steps of 1 cm."),
    ] = RangeMode.MM,
    noise: Annotated[
        bool, typer.Option("--noise/--no-noise", help="With the device's errors, or without.")
    ] = True,
    seed: Annotated[
        int, typer.Option("--seed", metavar="N", help="Which device: its errors follow from it.")
    ] = 0,
    up: UpOption = None,
    device: DeviceOption = None,
) -> None:
    """Take one scan of a laser scanner, a SICK LMS200."""
    from omnisim.cli.scan import ScanRequest, run

    request = ScanRequest(scene, output, plot, at, yaw, resolution, mode, noise, seed, up, device)
    run(request, out, err)


@app.command()
def validate(
    output: Annotated[
        Path,
        typer.Option("-o", "--output", help="Folder for report.html, report.json and figures."),
    ],
    quick: Annotated[
        bool, typer.Option("--quick", help="Leave out the path tracer, which takes longest.")
    ] = False,
    only: Annotated[
        list[str] | None,
        typer.Option("--only", metavar="CHECK", help="Only this check; may be repeated."),
    ] = None,
    device: DeviceOption = None,
) -> None:
    """Prove the geometry: the paper's figures, and independent oracles; 1 if a bound fails."""
    from omnisim.cli.validate import run

    if not run(output, quick, only or [], device, out, err):
        raise typer.Exit(1)


@app.command()
def experiments(
    output: Annotated[
        Path,
        typer.Option(
            "-o", "--output", help="Folder for the drives, report.html, report.json and figures."
        ),
    ],
    device: DeviceOption = None,
) -> None:
    """Repeat the paper's experiments, a robot that finds itself; 1 if a bound fails."""
    from omnisim.cli.experiments import run

    if not run(output, device, out, err):
        raise typer.Exit(1)


@app.command()
def mirror(
    output: Annotated[Path, typer.Option("-o", "--output", help="Mesh: .glb, .obj or .ply.")],
    polygons: Annotated[
        int | None,
        typer.Option("-n", "--polygons", help="Polygons. [dim]1024, or the sensor file's[/]"),
    ] = None,
    sensor: Annotated[
        Path | None, typer.Option("--sensor", help="Sensor file; by default the paper's mirror.")
    ] = None,
) -> None:
    """Write the mirror's mesh, textured for the unfolded cube, to open in Blender."""
    from omnisim.cli.mirror import run

    run(output, polygons, sensor, out)


@app.command()
def sensor(
    check: Annotated[
        Path | None, typer.Option("--check", metavar="FILE", help="Check this sensor file.")
    ] = None,
) -> None:
    """Print the default sensor file, every key with a comment, or check one."""
    from omnisim.cli.sensor import run

    run(check, out)


def main() -> None:
    """Run the command line; what a user can act on is one line and exit status 1."""
    try:
        app()
    except SystemExit as stopped:
        if stopped.code == INTERRUPTED:  # typer says nothing
            err.print("interrupted")
        raise
    except OmnisimError as error:
        for line in str(error).splitlines():
            err.print(f"[bold red]error:[/] {_plain(line)}")
        sys.exit(1)


def _plain(text: str) -> str:
    from rich.markup import escape

    return escape(text)
