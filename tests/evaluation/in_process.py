"""Drives and estimators of an evaluation, run in the test's process.

Other tests are about their own processes, each of which takes seconds to import what it needs.
"""

import contextlib
import io
import sys
import threading
from pathlib import Path

from omnisim.apps.cli.app import main
from omnisim.evaluation import estimator_worker
from omnisim.evaluation.child_process import ChildProcesses

_LOCK = threading.Lock()  # of the arguments and of the output, which a process has once


def run_in_process(monkeypatch):
    """Run the modules that an evaluation starts as functions."""
    monkeypatch.setattr(ChildProcesses, "run", _run)


def _run(children, module, arguments, output, limit_s=None):
    text = io.StringIO()
    with _LOCK, contextlib.redirect_stdout(text), contextlib.redirect_stderr(text):
        status = _STARTED[module](arguments)
    output.write(text.getvalue().encode())
    return status


def _command(arguments):
    before, sys.argv = sys.argv, ["omnisim", *arguments]
    try:
        main()
    except SystemExit as stopped:
        return stopped.code
    finally:
        sys.argv = before
    return 0


def _estimator(arguments):
    run, name, folder = arguments
    estimator_worker.main(Path(run), name, Path(folder))
    return 0


_STARTED = {"omnisim": _command, "omnisim.evaluation.estimator_worker": _estimator}
