"""Parameters of the commands of `omnisim robot`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from omnisim.apps.cli.arguments import ResourcesOption
from omnisim.apps.cli.completion import complete_robot


@dataclass(frozen=True)
class CheckRequest:
    """Parameters of `omnisim robot check`."""

    robot: Annotated[
        str,
        typer.Argument(
            metavar="FILE",
            autocompletion=complete_robot,
            help="Robot file, folder with a robot.toml, or built-in name.",
        ),
    ]


@dataclass(frozen=True)
class ImportRequest:
    """Parameters of `omnisim robot import`."""

    configuration: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="Configuration of USARSim (USARBot.ini), or a model: .sdf .urdf .xml.",
        ),
    ]
    output: Annotated[
        Path,
        typer.Option("-o", "--output", metavar="FILE", help="Robot file: .toml."),
    ]
    robot_class: Annotated[
        str | None,
        typer.Option(
            "--class",
            metavar="NAME",
            help="Class of the robot, such as P2AT, or name of the model.",
            show_default="the file's only one",
        ),
    ] = None
    unreal_units: Annotated[
        bool,
        typer.Option(
            "--unreal-units",
            help="Read the file in Unreal units: 250 to a meter, z up, 65536 to a turn.",
            show_default="meters, z down, radians",
        ),
    ] = False
    origin_height_m: Annotated[
        float | None,
        typer.Option(
            "--origin-height",
            metavar="M",
            help="Height of USARSim's origin of the robot above the ground.",
            show_default="0",
        ),
    ] = None
    resources: ResourcesOption = None
