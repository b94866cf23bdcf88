"""Processes that draw cases, each by one driver."""

from __future__ import annotations

import fcntl
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parents[2]
VIRGL_SERVER = "virgl_test_server"
LLVMPIPE = {"LIBGL_ALWAYS_SOFTWARE": "1", "GALLIUM_DRIVER": "llvmpipe"}
# virgl's clients do not know draw parameters: scenes are drawn item by item. Without them llvmpipe
# takes the same way, and all that is left to differ is the driver.
LLVMPIPE_LIKE_VIRGL = LLVMPIPE | {
    "MESA_EXTENSION_OVERRIDE": (
        "-GL_ARB_shader_draw_parameters -GL_ARB_shader_viewport_layer_array"
    )
}
# Mesa's client says 4.3 where the server has all of 4.5.
_VIRGL = {
    "LIBGL_ALWAYS_SOFTWARE": "1",
    "GALLIUM_DRIVER": "virpipe",
    "MESA_GL_VERSION_OVERRIDE": "4.6",
    "MESA_GLSL_VERSION_OVERRIDE": "460",
}
_SOCKET = Path("/tmp/.virgl_test")  # the only one that Mesa's client knows
_LOCK = Path(tempfile.gettempdir()) / "omnisim-virgl.lock"
_MAX_START_S = 30.0


def draw_by(environment: Mapping[str, str], folder: Path, *options: str) -> str:
    """Draw cases into a folder in a process of its own, by the driver of an environment.

    Returns:
        What it printed: the driver, and seconds of the cases.

    Raises:
        RuntimeError: it failed, with what it said.
    """
    command = [sys.executable, "-m", "tests.drivers.draw", "--folder", str(folder), *options]
    ours = {"LP_NUM_THREADS": "0", "PYTHONPATH": str(CHECKOUT)}
    done = subprocess.run(
        command, cwd=CHECKOUT, env={**os.environ, **ours, **environment},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)}: {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout


def draw_by_virgl(folder: Path, *options: str) -> str:
    """Draw cases by virgl, likewise: with a server for this process alone."""
    with virgl_server():
        return draw_by(_VIRGL, folder, *options)


@contextmanager
def virgl_server() -> Iterator[None]:
    """A server of virgl that draws by llvmpipe; there is one at a time on a machine."""
    server = shutil.which(VIRGL_SERVER)
    if server is None:
        raise FileNotFoundError(f"{VIRGL_SERVER} is missing: apt-get install virgl-server")
    with _LOCK.open("w") as lock, tempfile.TemporaryFile() as log:
        fcntl.flock(lock, fcntl.LOCK_EX)
        _SOCKET.unlink(missing_ok=True)
        process = subprocess.Popen(
            [server, "--use-egl-surfaceless"], stdout=log, stderr=log,
            env={**os.environ, **LLVMPIPE, "LP_NUM_THREADS": "0"},
        )  # fmt: skip
        try:
            _wait_for_socket(process)
            yield
        finally:
            process.terminate()
            process.wait()


def _wait_for_socket(process: subprocess.Popen[bytes]) -> None:
    start_s = time.monotonic()
    while not _SOCKET.exists():
        if process.poll() is not None or time.monotonic() - start_s > _MAX_START_S:
            raise RuntimeError(f"{VIRGL_SERVER} did not start: exit status {process.poll()}")
        time.sleep(0.05)
