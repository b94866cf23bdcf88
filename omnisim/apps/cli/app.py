"""Command-line application and its error handling.

Commands raise OmnisimError for every fault that a user can fix.
"""

import errno
import gc
import os
import sys
from typing import NoReturn

from omnisim.apps.cli import INTERRUPTED
from omnisim.apps.cli.commands import COMMANDS
from omnisim.apps.cli.console import err
from omnisim.apps.cli.plain_parser import parse
from omnisim.core.errors import OmnisimError

_COMPLETION = "_OMNISIM_COMPLETE"  # set by the shell that asks for completions


def main() -> None:
    """Run the command line; an OmnisimError prints its message and exits with status 1."""
    gc.disable()  # until the command's modules are imported, which drop nothing
    try:
        sys.exit(_run(sys.argv[1:]))
    except SystemExit as stopped:
        if stopped.code == INTERRUPTED:  # typer prints no message
            err.print("interrupted")
        raise
    except OmnisimError as error:
        _fail(str(error))
    except OSError as error:
        if error.filename is not None:
            raise
        if error.errno == errno.ENOENT:  # from getcwd
            _fail("the working directory is not there any more")
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # else flushing at exit fails again
        if error.errno == errno.EPIPE:
            sys.exit(1)  # whoever read the output, such as `head`, has seen enough
        _fail(f"standard output: cannot be written: {error.strerror}")
    finally:
        gc.enable()


def _run(arguments: list[str]) -> int:
    """Run a command line; return the exit status."""
    command = None if _COMPLETION in os.environ else parse(arguments, COMMANDS)
    if command is not None:
        try:
            return command.entry.call(command.path, command.request)
        except KeyboardInterrupt:
            return INTERRUPTED
    from omnisim.apps.cli.typer_app import app  # slow to import

    app(prog_name="omnisim")
    return 0


def _fail(message: str) -> NoReturn:
    for line in message.splitlines():
        err.print_error(line)
    sys.exit(1)
