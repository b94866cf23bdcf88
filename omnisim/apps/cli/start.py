"""Entry point: handles Ctrl-C before any slow import, and leaves quickly at the end.

Its own imports are limited to modules that Python has already imported.
"""

import _signal as signal  # type: ignore[import-not-found]  # signal imports enum, re and others
import os
import sys
from io import TextIOWrapper

from omnisim.apps.cli import INTERRUPTED, at_interrupt

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from typing import Any

# Settings of libraries, unless the user has others.
_SETTINGS = {
    "OPENBLAS_NUM_THREADS": "1",  # products of small matrices: threads would spin between them
    "PYDANTIC_DISABLE_PLUGINS": "__all__",  # to find them reads the metadata of all packages
}
_BAR = b"\r\x1b[2K\x1b[?25h"  # clears a bar of progress, and shows the cursor that it has hidden


def main() -> None:
    """Run the command line; Ctrl-C prints one line and exits with status 130 at any moment."""
    # any other handler means that SIGINT is ignored, as under nohup
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _interrupt)
    import atexit
    import gc

    status: list[int] = []
    atexit.register(_leave, status)  # the first to be registered is the last to be called
    gc.set_threshold(50_000)  # imports leave no garbage, but a million objects to look at
    for name, value in _SETTINGS.items():
        os.environ.setdefault(name, value)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):  # None if the stream is closed
            stream.reconfigure(errors="backslashreplace")  # an ASCII console lacks ×
    from omnisim.apps.cli.app import main as run

    try:
        run()
    except SystemExit as stopped:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # the work is done: nothing to interrupt
        status.append(stopped.code if isinstance(stopped.code, int) else 0)
        raise


def _leave(status: list[int]) -> None:
    """Exit at once, and leave freeing the memory to the operating system.

    Python and the graphics driver take 0.2 s for it after an image of the scene soccer, of 1.7 s in
    all.
    """
    if not status:  # a defect, whose traceback was printed
        return
    try:
        for stream in (sys.stdout, sys.stderr):
            if stream is not None:
                stream.flush()
    except (OSError, ValueError):
        return  # Python reports it
    os._exit(status[0])


def _imported(module: str, name: str) -> "Callable[[], Iterable[Any]]":
    """Function of a module, or one that does nothing unless the module is imported completely."""
    return getattr(sys.modules.get(module), name, tuple)


def _interrupt(*signal_and_frame: object) -> None:
    """Exit at once, after removing files that are written in part: the command resumes the rest.

    An exception would be lost, or abort the process, in libraries that import modules or call back.
    """
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # a second Ctrl-C kills the process
    for worker in _imported("multiprocessing", "active_children")():
        worker.terminate()
    for _ in range(2):  # another thread may begin a file meanwhile
        _imported("omnisim.core.files.atomic_file", "remove_partials")()
    lines = [line for state in at_interrupt if (line := state())]
    text = "\n".join((*lines, "interrupted\n"))
    os.write(2, (_BAR if os.isatty(2) else b"") + text.encode(errors="backslashreplace"))
    os._exit(INTERRUPTED)
