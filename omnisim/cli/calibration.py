"""`omnisim calibration`: its commands, which parse, call and print."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from omnisim.cli.consoles import err, out

calibration_app = typer.Typer(
    name="calibration",
    help="Calibration files of other tools: convert, show, list the formats.",
    no_args_is_help=True,
)
InputArgument = Annotated[
    Path,
    typer.Argument(
        metavar="FILE", help="A calibration file, a sensor file, or a picture that omnisim took."
    ),
]
FormatOption = Annotated[
    str | None,
    typer.Option("--format", metavar="FORMAT", help="Of FILE. [dim]what it looks like[/]"),
]
NameOption = Annotated[
    str | None,
    typer.Option("--camera-name", metavar="NAME", help="Which camera of the file."),
]
MirroredOption = Annotated[
    bool | None,
    typer.Option(
        "--mirrored/--not-mirrored",
        help="The file's camera looks into a mirror. [dim]as its remarks say, or not[/]",
        show_default=False,
    ),
]


@calibration_app.command()
def convert(
    source: InputArgument,
    to: Annotated[
        str, typer.Option("--to", metavar="FORMAT", help="See `omnisim calibration formats`.")
    ],
    output: Annotated[Path, typer.Option("-o", "--output", help="File to write.")],
    camera_name: NameOption = None,
    format: FormatOption = None,
    model: Annotated[
        str | None,
        typer.Option(
            "--model", metavar="MODEL", help="Write by this model. [dim]the same, or the nearest[/]"
        ),
    ] = None,
    mirrored: MirroredOption = None,
) -> None:
    """Write a calibration in another format, exactly or by the best fit, and say which."""
    from omnisim.cli.calibration_convert import ConvertRequest, run

    run(ConvertRequest(source, to, output, camera_name, format, model, mirrored), out, err)


@calibration_app.command()
def show(
    source: InputArgument,
    camera_name: NameOption = None,
    format: FormatOption = None,
    mirrored: MirroredOption = None,
) -> None:
    """Show the cameras of a calibration file: model, parameters, field of view, valid domain."""
    from omnisim.cli.calibration_show import run

    run(source, camera_name, format, mirrored, out, err)


@calibration_app.command()
def formats() -> None:
    """List the formats, and the camera models that each says exactly."""
    from omnisim.cli.calibration_formats import run

    run(out)
