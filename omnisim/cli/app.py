"""The command line: parse, call, print."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from omnisim.cli.calibration import calibration_app
from omnisim.cli.consoles import err, out
from omnisim.cli.landmarks import landmarks_app
from omnisim.cli.picture_commands import mirror, render, scan, sensor, unwarp
from omnisim.cli.proof_commands import experiments, info, validate
from omnisim.cli.robot import robot_app
from omnisim.cli.run_commands import drive, localize, plot, video
from omnisim.errors import OmnisimError
from omnisim.version import __version__

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

for command in (
    info, render, drive, localize, plot, video, unwarp, scan, validate, experiments, mirror, sensor,
):  # fmt: skip
    app.command()(command)
for group in (robot_app, landmarks_app, calibration_app):
    app.add_typer(group)


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
