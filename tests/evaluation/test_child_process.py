"""Child processes: limits, interruption, and the death of their parent."""

import io
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from omnisim.evaluation.child_process import ChildProcesses

ROOT = str(Path(__file__).parents[2])
SLEEPER = """
import os, pathlib, subprocess, sys, time
child = subprocess.Popen(["sleep", "600"])
pathlib.Path(sys.argv[1]).write_text(f"{os.getpid()} {child.pid}")
time.sleep(600)
"""


@pytest.fixture
def module(tmp_path, monkeypatch):
    """Module that sleeps, as does its own child; it writes their numbers to a file."""
    (tmp_path / "sleeper.py").write_text(SLEEPER)
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}:{ROOT}")
    return tmp_path


def _wait_for(condition, limit_s=120.0):
    end_s = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < end_s
        time.sleep(0.05)


def _is_alive(process):
    """State of a process: true if it runs; one that has ended, and was not waited for, does not."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def _numbers(file):
    _wait_for(lambda: file.exists() and file.read_text())
    return [int(word) for word in file.read_text().split()]


def test_a_limit_ends_a_process_and_its_children(module):
    with (module / "output").open("wb") as output:
        status = ChildProcesses().run("sleeper", [str(module / "numbers")], output, limit_s=3.0)
    assert status is None
    _wait_for(lambda: not any(map(_is_alive, _numbers(module / "numbers"))))


def test_all_are_ended_together(module):
    children, raised = ChildProcesses(), []

    def work():
        with (module / "output").open("wb") as output:
            try:
                children.run("sleeper", [str(module / "numbers")], output)
            except KeyboardInterrupt as reason:
                raised.append(reason)

    thread = threading.Thread(target=work)
    thread.start()
    numbers = _numbers(module / "numbers")
    children.end()
    thread.join(30.0)
    assert len(raised) == 1
    _wait_for(lambda: not any(map(_is_alive, numbers)))
    with pytest.raises(KeyboardInterrupt):
        children.run("sleeper", [], io.BytesIO())


def test_children_end_with_a_killed_parent(module):
    code = (
        "import sys; from omnisim.evaluation.child_process import ChildProcesses\n"
        "ChildProcesses().run('sleeper', [sys.argv[1]], open(sys.argv[2], 'wb'))"
    )
    words = [sys.executable, "-c", code, str(module / "numbers"), str(module / "output")]
    parent = subprocess.Popen(words)
    numbers = _numbers(module / "numbers")
    os.kill(parent.pid, signal.SIGKILL)
    parent.wait()
    _wait_for(lambda: not any(map(_is_alive, numbers)))
