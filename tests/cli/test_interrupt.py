"""Ctrl-C: a word, exit status 130, and nothing lost."""

import signal
import subprocess
import sys
import time

import pytest


@pytest.mark.usefixtures("needs_opengl")
def test_an_interrupted_drive_says_how_to_go_on(tmp_path):
    command = [sys.executable, "-c", "from omnisim.cli.app import main; main()", "drive", "soccer"]
    command += ["--robot", "superscout", "--path", "lap", "--step", "0.05", "-o", "run"]
    process = subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    patience = time.monotonic() + 60.0
    while not list(tmp_path.glob("run/omnicam/00000[3-9].png")) and time.monotonic() < patience:
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    _, error = process.communicate(timeout=60)
    assert process.returncode == 130
    *_, told, word = error.splitlines()
    assert told.startswith("run: ")
    assert told.endswith(" steps are there: the same command goes on")
    assert word == "interrupted"
    assert not list(tmp_path.rglob(".omnisim-*"))
