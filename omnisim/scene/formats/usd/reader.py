"""USD stages as scene contents, read in a separate process."""

from __future__ import annotations

import os
import pickle
import resource
import signal
import subprocess
import sys
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from omnisim.core.arrays import Floats
from omnisim.core.errors import OmnisimError, SceneError
from omnisim.core.files.sources import SourceReader
from omnisim.scene.formats.imported_scene import FileAxes, ImportedScene


def read_usd(path: Path, axes: FileAxes, reader: SourceReader) -> tuple[ImportedScene, Floats]:
    """Read a stage in a separate process; `axes` override its up axis and unit.

    Returns:
        Scene contents, and the transform (4, 4) from the stage to the world frame.

    Raises:
        SceneError: the stage is damaged.
    """
    read, matrix, its_reader = call_isolated(_read, path, axes)
    reader.update(its_reader)
    return read, matrix


def _read(path: Path, axes: FileAxes) -> tuple[ImportedScene, Floats, SourceReader]:
    from omnisim.scene.formats.usd.stage_reader import read_stage  # imports usd-core, slow

    reader = SourceReader()
    return *read_stage(path, axes, reader), reader


# Function calls in a separate process, to contain a library's crashes, output and memory use.

Result = TypeVar("Result")
# Processor time: a stage of some hundred megabytes takes a minute, a damaged one may never end.
LIMIT_CPU_S = 300
_MAIN = "import sys; sys.path[:] = {path!r}; from {module} import serve; serve()"


@dataclass(frozen=True)
class _Defect:
    """Unexpected exception."""

    traceback: str


def call_isolated(function: Callable[..., Result], *arguments: object) -> Result:
    """Result of a module-level function, called with pickled arguments in another process."""
    main = _MAIN.format(path=sys.path, module=__name__)
    # installed usd-core plug-ins could fetch files from the network
    environment = {
        key: value for key, value in os.environ.items() if not key.startswith("PXR_PLUG")
    }
    with subprocess.Popen(
        [sys.executable, "-c", main],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env=environment,
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            pickle.dump((function, arguments, LIMIT_CPU_S), process.stdin)
            process.stdin.close()
            outcome = pickle.load(process.stdout)
        except (EOFError, BrokenPipeError, pickle.UnpicklingError):
            reason = "cannot be read as USD: is damaged: usd-core crashed"
            if process.wait() in (-signal.SIGKILL, -signal.SIGXCPU):
                limit = f"within {LIMIT_CPU_S} s of processor time"
                reason = f"was not read {limit}, or takes too much memory"
            raise SceneError(reason) from None
        except BaseException:
            process.kill()
            raise
    if isinstance(outcome, OmnisimError):
        raise outcome
    if isinstance(outcome, _Defect):
        raise RuntimeError(outcome.traceback)
    return outcome


def serve() -> None:
    """Call the function from standard input and write its result to standard output."""
    with os.fdopen(os.dup(1), "wb") as output:
        os.dup2(2, 1)  # keeps a library's prints out of the result
        function, arguments, limit_s = pickle.load(sys.stdin.buffer)
        resource.setrlimit(resource.RLIMIT_CPU, (limit_s, limit_s))
        bytes_of_machine = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
        resource.setrlimit(resource.RLIMIT_AS, (bytes_of_machine, bytes_of_machine))
        try:
            outcome = function(*arguments)
        except OmnisimError as reason:
            outcome = reason
        except MemoryError:
            outcome = SceneError("needs more memory than available")
        except Exception:
            outcome = _Defect(traceback.format_exc())
        pickle.dump(outcome, output, pickle.HIGHEST_PROTOCOL)
