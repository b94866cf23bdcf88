"""Typer's application: help, completion, and explanations of invalid command lines."""

from typing import Annotated, Any

import typer

from omnisim.apps.cli.command import Group, make_commands
from omnisim.apps.cli.commands import COMMANDS
from omnisim.apps.cli.console import out
from omnisim.core.version import __version__


class _Commands(Group):
    """Top-level group with all commands of the table."""

    def __init__(self, **settings: Any):
        super().__init__(**settings | {"commands": make_commands(COMMANDS)})


app = typer.Typer(
    name="omnisim",
    cls=_Commands,
    help="Simulator of omnidirectional cameras, accurate to a tenth of a pixel.",
    no_args_is_help=True,
    rich_markup_mode="rich",
    add_completion=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _print_version(is_wanted: bool) -> None:
    if is_wanted:
        out.print(f"omnisim {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Print the version."
        ),
    ] = False,
) -> None:
    """Parse the options of `omnisim` itself."""
