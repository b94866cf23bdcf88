"""Commands that say what is there, and prove what is claimed."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from omnisim.cli.arguments import DeviceOption
from omnisim.cli.consoles import err, out


def info() -> None:
    """Show what draws here, what is missing, and how to get it."""
    from omnisim.cli.info import run

    run(out)


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
