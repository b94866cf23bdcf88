"""`omnisim robot`: its commands, which parse, call and print."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from omnisim.cli.consoles import err, out

robot_app = typer.Typer(
    name="robot", help="Robots: list, check, or import from USARSim.", no_args_is_help=True
)


@robot_app.command("list")
def list_robots() -> None:
    """List the built-in robots."""
    from omnisim.cli.robot_list import run

    run(out)


@robot_app.command()
def check(
    robot: Annotated[
        str,
        typer.Argument(
            metavar="FILE", help="A robot file, a folder with a robot.toml, or a built-in name."
        ),
    ],
) -> None:
    """Check a robot file with its body and sensors, and say what it describes."""
    from omnisim.cli.robot_check import run

    run(robot, out, err)


@robot_app.command("import")
def import_(
    configuration: Annotated[
        Path, typer.Argument(metavar="USARBot.ini", help="A configuration of USARSim.")
    ],
    output: Annotated[Path, typer.Option("-o", "--output", help="Robot file: .toml")],
    robot_class: Annotated[
        str | None,
        typer.Option(
            "--class", metavar="NAME", help="Which robot, as P2AT. [dim]the only one in the file[/]"
        ),
    ] = None,
    unreal_units: Annotated[
        bool,
        typer.Option(
            "--unreal-units",
            help="The file has the engine's units: 250 to a metre, z up, 65536 to a turn; "
            "by default metres, z down, and radians.",
        ),
    ] = False,
    origin_height: Annotated[
        float | None,
        typer.Option(
            "--origin-height",
            metavar="M",
            help="Height of USARSim's origin of the robot above the ground. [dim]0[/]",
        ),
    ] = None,
) -> None:
    """Turn a robot of USARSim's configuration into a robot file."""
    from omnisim.cli.robot_import import ImportRequest, run

    request = ImportRequest(configuration, output, robot_class, unreal_units, origin_height)
    run(request, out, err)
