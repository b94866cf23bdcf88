"""Parameters of `omnisim live`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from omnisim.apps.cli.arguments import (
    AtOption,
    BakedOption,
    CalibrationOption,
    CameraNameOption,
    DeviceOption,
    MirroredOption,
    OpticsOption,
    PitchOption,
    PresetOption,
    QualityOption,
    ResourcesOption,
    SensorOption,
    SizeOption,
    SkyOption,
    TimeOption,
    UnitOption,
    UnlitOption,
    UpOption,
    YawOption,
)
from omnisim.apps.cli.completion import complete_robot, complete_scene

PAGE = "Page"  # panel of a help page


@dataclass(frozen=True)
class LiveRequest:
    """Parameters of `omnisim live`."""

    scene: Annotated[
        str | None,
        typer.Argument(
            metavar="[SCENE]",
            autocompletion=complete_scene,
            help="Scene file, or name of a built-in scene.",
            show_default="soccer",
        ),
    ] = None
    robot: Annotated[
        str | None,
        typer.Option(
            "--robot",
            metavar="NAME|FILE",
            autocompletion=complete_robot,
            help="Robot to drive, whose camera is shown; without one the camera flies freely.",
        ),
    ] = None
    run: Annotated[
        Path | None,
        typer.Option(
            "--run", metavar="DIR", help="Replay a recorded run instead, with its images."
        ),
    ] = None
    sensor: SensorOption = None
    optics: OpticsOption = None
    camera: CalibrationOption = None
    camera_name: CameraNameOption = None
    mirrored: MirroredOption = None
    preset: PresetOption = None
    size_px: SizeOption = None
    quality: QualityOption = None
    at: AtOption = None
    yaw_deg: YawOption = None
    pitch_deg: PitchOption = 0.0
    time_s: TimeOption = 0.0
    unlit: UnlitOption = False
    sky: SkyOption = None
    baked: BakedOption = None
    host: Annotated[
        str,
        typer.Option(
            "--host",
            metavar="ADDRESS",
            help="Address to listen on; any other than this machine's own asks for a token.",
            rich_help_panel=PAGE,
        ),
    ] = "localhost"
    port: Annotated[
        int,
        typer.Option(
            "--port",
            metavar="N",
            min=0,
            max=65535,
            help="Port to listen on; 0: a free one.",
            rich_help_panel=PAGE,
        ),
    ] = 8080
    open: Annotated[
        bool,
        typer.Option("--open", help="Open the page in a browser.", rich_help_panel=PAGE),
    ] = False
    record: Annotated[
        Path | None,
        typer.Option(
            "--record",
            metavar="FILE",
            help="Record a short film of a drive around the start, and serve no page: .mp4 .mkv.",
            rich_help_panel=PAGE,
        ),
    ] = None
    up_axis: UpOption = None
    meters_per_unit: UnitOption = None
    resources: ResourcesOption = None
    device: DeviceOption = None
