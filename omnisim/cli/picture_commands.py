"""Commands that take or change one picture, or a scan; and what takes it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from omnisim.cli.arguments import (
    AlsoOption,
    AtOption,
    DeviceOption,
    LabelsOption,
    PictureOption,
    PolygonsOption,
    PresetOption,
    QualityOption,
    SceneArgument,
    SizeOption,
    UnlitOption,
    UpOption,
    YawOption,
)
from omnisim.cli.calibration import MirroredOption, NameOption
from omnisim.cli.choices import RangeMode, ViewKind
from omnisim.cli.consoles import err, out


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
    quality: QualityOption = None,
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
        turn_rate, rays, calibration, quality,
    )  # fmt: skip
    run(request, out, err)


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


def sensor(
    check: Annotated[
        Path | None, typer.Option("--check", metavar="FILE", help="Check this sensor file.")
    ] = None,
) -> None:
    """Print the default sensor file, every key with a comment, or check one."""
    from omnisim.cli.sensor import run

    run(check, out)
