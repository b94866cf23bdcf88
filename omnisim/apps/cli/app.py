"""Command-line application and its error handling.

Commands raise OmnisimError for every fault that a user can fix.
"""

import errno
import os
import sys
import warnings
from typing import Annotated, Any, NoReturn

import typer

from omnisim.apps.cli import INTERRUPTED
from omnisim.apps.cli.command import Group, make_commands
from omnisim.apps.cli.commands import COMMANDS
from omnisim.apps.cli.console import err, out, print_note
from omnisim.core.errors import NoticeWarning, OmnisimError
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


def main() -> None:
    """Run the command line; an OmnisimError prints its message and exits with its status."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("always", NoticeWarning)
            _print_notices()
            app(prog_name="omnisim")
    except SystemExit as stopped:
        if stopped.code == INTERRUPTED:  # typer prints no message
            err.print("interrupted")
        raise
    except OmnisimError as error:
        _fail(str(error), error.exit_status)
    except OSError as error:
        if error.filename is not None:
            raise
        if error.errno == errno.ENOENT:  # from getcwd
            _fail("the working directory is not there any more")
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # else flushing at exit fails again
        _fail(f"standard output: cannot be written: {error.strerror}")


def _print_notices() -> None:
    """Print each notice about a file once, as a note."""
    printed: set[str] = set()
    show = warnings.showwarning

    def show_warning(message: Any, category: Any, *place: Any, **more: Any) -> None:
        if not issubclass(category, NoticeWarning):
            show(message, category, *place, **more)
        elif str(message) not in printed:
            printed.add(str(message))
            print_note(str(message))

    warnings.showwarning = show_warning


def _fail(message: str, status: int = 1) -> NoReturn:
    from rich.markup import escape

    for word in sys.argv[1:]:  # a name with line breaks: still one line
        message = message.replace(word, " ".join(word.splitlines())) if word else message
    for line in message.splitlines():
        err.print(f"[bold red]error:[/] {escape(line)}")
    sys.exit(status)
