"""Parameters of `omnisim validate` and `omnisim experiments`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from omnisim.apps.cli.arguments import DeviceOption
from omnisim.apps.cli.completion import CHECKS, one_of


@dataclass(frozen=True)
class ValidateRequest:
    """Parameters of `omnisim validate`."""

    output: Annotated[
        Path,
        typer.Option(
            "-o", "--output", metavar="DIR", help="Folder for report.html, report.json and figures."
        ),
    ]
    quick: Annotated[
        bool, typer.Option("--quick", help="Leave out the path tracer, the slowest check.")
    ] = False
    only: Annotated[
        list[str] | None,
        typer.Option(
            "--only",
            metavar="CHECK",
            autocompletion=one_of(*CHECKS),
            help="Only this check; may be repeated.",
        ),
    ] = None
    device: DeviceOption = None


@dataclass(frozen=True)
class ExperimentsRequest:
    """Parameters of `omnisim experiments`."""

    output: Annotated[
        Path,
        typer.Option(
            "-o",
            "--output",
            metavar="DIR",
            help="Folder for the drives, report.html, report.json and figures.",
        ),
    ]
    device: DeviceOption = None
