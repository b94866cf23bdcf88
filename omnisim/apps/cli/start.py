"""Entry point: handles Ctrl-C before any slow import.

Its own imports are limited to modules that Python has already imported.
"""

import _signal as signal  # type: ignore[import-not-found]  # signal imports enum, re and others
import os
import sys
from io import TextIOWrapper

from omnisim.apps.cli import INTERRUPTED

TYPE_CHECKING = False
if TYPE_CHECKING:
    from types import FrameType

# Imports swallow the exception or abort; moderngl's C code calls Python and does not expect it;
# OpenImageIO's bindings and the building of pydantic's schemas turn it into another error.
_NOT_TO_INTERRUPT = {
    "_frozen_importlib", "importlib._bootstrap", "moderngl", "_moderngl",
    "omnisim.core.files.image_files", "pydantic.plugin._schema_validator",
}  # fmt: skip

# Settings of libraries, unless the user has others.
_SETTINGS = {
    "OPENBLAS_NUM_THREADS": "1",  # products of small matrices: threads would spin between them
    "PYDANTIC_DISABLE_PLUGINS": "__all__",  # to find them reads the metadata of all packages
}


def main() -> None:
    """Run the command line; Ctrl-C prints one line and exits with status 130 at any moment."""
    try:
        # any other handler means that SIGINT is ignored, as under nohup
        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, _interrupt)
        import gc

        gc.disable()  # imports leave no garbage; a command enables it after its own
        for name, value in _SETTINGS.items():
            os.environ.setdefault(name, value)
        for stream in (sys.stdout, sys.stderr):
            if isinstance(stream, TextIOWrapper):  # None if the stream is closed
                stream.reconfigure(errors="backslashreplace")  # an ASCII console lacks ×
        from omnisim.apps.cli.app import main as run

        run()
    except KeyboardInterrupt:
        _end(signal.SIGINT, None)
    except SystemExit as stopped:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # the work is done: nothing left to interrupt
        _leave(stopped.code)
        raise
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)


def _leave(status: object) -> None:
    """Exit with a status as Python does, but leave freeing the memory to the operating system.

    Python and the graphics driver take a tenth of a second for it. Returns if threads are still
    running, or if output cannot be written, so that Python waits for them or reports it.
    """
    threading = sys.modules.get("threading")
    is_alone = threading is None or threading.active_count() == 1
    if not is_alone or not (status is None or isinstance(status, int)):
        return
    import atexit

    atexit._run_exitfuncs()
    try:
        for stream in (sys.stdout, sys.stderr):
            if stream is not None:
                stream.flush()
    except (OSError, ValueError):
        return
    os._exit(status or 0)


def _interrupt(signal_number: int, frame: "FrameType | None") -> None:
    """Raise KeyboardInterrupt, or exit at once inside modules that cannot handle it."""
    signal.signal(signal.SIGINT, _end)  # a second Ctrl-C exits at once
    while frame is not None:
        if frame.f_globals.get("__name__") in _NOT_TO_INTERRUPT:
            _end(signal_number, frame)
        frame = frame.f_back
    raise KeyboardInterrupt


def _end(signal_number: int, frame: "FrameType | None") -> None:
    """Exit at once, after removing partially written files."""
    files = sys.modules.get("omnisim.core.files.atomic_file")
    remove_partials = getattr(files, "remove_partials", None)  # None while it is being imported
    if remove_partials is not None:
        remove_partials()
    os.write(2, b"interrupted\n")
    os._exit(INTERRUPTED)
