"""Child processes that end with their parent, at their time limit, or when a sweep is interrupted.

A child has its own process group, and its standard input is a pipe that its parent holds open. When
the parent dies, by whatever signal, the pipe closes, and the child ends its group.
"""

from __future__ import annotations

import os
import runpy
import signal
import subprocess
import sys
import threading
from collections.abc import Sequence
from contextlib import suppress
from typing import IO

_MODULE = "omnisim.evaluation.child_process"


class ChildProcesses:
    """Running child processes; another thread can end them all."""

    def __init__(self) -> None:
        self._running: set[subprocess.Popen[bytes]] = set()
        self._lock = threading.Lock()
        self._is_ended = False

    def run(
        self, module: str, arguments: Sequence[str], output: IO[bytes], limit_s: float | None = None
    ) -> int | None:
        """Run a Python module in its own process, until the process ends.

        Args:
            module: module, run as by `python -m`.
            arguments: its arguments.
            output: file for its standard output and standard error.
            limit_s: time limit, after which it and its own children are ended; None: no limit.

        Returns:
            Exit status, negative for a signal; None: ended at the time limit.

        Raises:
            KeyboardInterrupt: `end` was called.
        """
        with self._lock:
            if self._is_ended:
                raise KeyboardInterrupt
            process = subprocess.Popen(
                [sys.executable, "-m", _MODULE, module, *arguments],
                stdin=subprocess.PIPE, stdout=output, stderr=subprocess.STDOUT,
                start_new_session=True,
            )  # fmt: skip
            self._running.add(process)
        try:
            status = process.wait(limit_s)
        except subprocess.TimeoutExpired:
            return None
        finally:
            with self._lock:
                self._running.discard(process)
            if process.poll() is None:
                _kill_group(process)
                process.wait()
            if process.stdin is not None:
                process.stdin.close()
        if self._is_ended:
            raise KeyboardInterrupt
        return status

    def end(self) -> None:
        """End all running children, and refuse to start others."""
        with self._lock:
            self._is_ended = True
            for process in self._running:
                _kill_group(process)


def _kill_group(process: subprocess.Popen[bytes]) -> None:
    if process.returncode is None:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)


def _end_with_parent() -> None:
    """End this process's group when its standard input closes; other readers find it empty."""
    pipe = os.dup(0)
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)

    def watch() -> None:
        while os.read(pipe, 1024):
            pass
        os.killpg(0, signal.SIGKILL)

    threading.Thread(target=watch, daemon=True).start()


if __name__ == "__main__":
    _end_with_parent()
    del sys.argv[0]
    runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)
