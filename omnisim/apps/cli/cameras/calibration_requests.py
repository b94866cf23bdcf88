"""Parameters of the commands of `omnisim calibration`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from omnisim.apps.cli.arguments import CameraNameOption, MirroredOption
from omnisim.apps.cli.completion import CALIBRATION_FORMATS, one_of

SourceArgument = Annotated[
    Path,
    typer.Argument(metavar="FILE", help="Calibration file, sensor file, or an image of omnisim's."),
]
FormatOption = Annotated[
    str | None,
    typer.Option(
        "--format",
        metavar="FORMAT",
        autocompletion=one_of(*CALIBRATION_FORMATS),
        help="Format of FILE.",
        show_default="detected",
    ),
]


@dataclass(frozen=True)
class ConvertRequest:
    """Parameters of `omnisim calibration convert`."""

    to: Annotated[
        str,
        typer.Option(
            "--to",
            metavar="FORMAT",
            autocompletion=one_of(*CALIBRATION_FORMATS),
            help="Format to write, one of `omnisim calibration formats`.",
        ),
    ]
    output: Annotated[
        Path,
        typer.Option("-o", "--output", metavar="FILE", help="Calibration file to write."),
    ]
    camera_name: CameraNameOption = None
    format: FormatOption = None
    model: Annotated[
        str | None,
        typer.Option(
            "--model",
            metavar="MODEL",
            help="Camera model to write.",
            show_default="the same, or the nearest",
        ),
    ] = None
    mirrored: MirroredOption = None
    optics: Annotated[
        Path | None,
        typer.Option(
            "--optics",
            metavar="FILE",
            help="Optics file, in place of FILE: a central camera is fitted to it.",
        ),
    ] = None
    at_distance: Annotated[
        list[float] | None,
        typer.Option(
            "--at-distance",
            metavar="METERS",
            help="Optics: tell residuals for points at these distances: --at-distance 0.3 1 5.",
            show_default="0.3, 1 and 5",
        ),
    ] = None
    right_at: Annotated[
        float | None,
        typer.Option(
            "--right-at",
            metavar="METERS",
            help="Optics: fit points at this distance from the viewpoint.",
            show_default="infinity",
        ),
    ] = None
    source: Annotated[
        str | None,
        typer.Argument(
            metavar="FILE",
            help="Calibration file, sensor file, or an image of omnisim's.",
            show_default=False,
        ),
    ] = None
    more_distances: Annotated[
        list[float] | None,
        typer.Argument(metavar="METERS", help="More distances.", show_default=False),
    ] = None


@dataclass(frozen=True)
class ShowRequest:
    """Parameters of `omnisim calibration show`."""

    source: SourceArgument
    camera_name: CameraNameOption = None
    format: FormatOption = None
    mirrored: MirroredOption = None
