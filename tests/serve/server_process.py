"""`omnisim serve` in a process of its own."""

import os
import re
import signal
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
READY = "Ctrl-C ends it."


@contextmanager
def serving(folder, *words):
    """Address of the last protocol of a server that runs in a folder, on free ports."""
    command = [sys.executable, "-m", "omnisim", "serve", *map(str, words), "--port", "0"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    with subprocess.Popen(
        command, cwd=folder, env=environment, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    ) as server:  # fmt: skip
        assert server.stdout is not None
        lines = []
        try:
            for line in server.stdout:
                lines.append(line.strip())
                if READY in line:
                    break
            else:
                raise AssertionError("\n".join(lines))
            yield re.findall(r"(?:ws|http)://\S+", " ".join(lines))[-1]
            server.send_signal(signal.SIGTERM)
            lines += server.stdout.read().splitlines()
            assert server.wait(60.0) == 0, lines
        finally:
            server.kill()
