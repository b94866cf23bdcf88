"""Consoles and working directories that are not as usual: one line, no traceback."""

import os
import subprocess
import sys

import numpy as np
import pytest

from omnisim.core.files.image_files import write_image


def run(folder, *arguments, encoding="utf-8", **options):
    return subprocess.run(
        [sys.executable, "-m", "omnisim", *arguments],
        cwd=folder,
        env={**os.environ, "PYTHONIOENCODING": encoding},
        stderr=subprocess.PIPE,
        check=False,
        **options,
    )


@pytest.mark.parametrize("arguments", [("sensor",), ("render", "--help")])
def test_full_device(tmp_path, arguments):
    with open("/dev/full", "wb") as full:
        done = run(tmp_path, *arguments, stdout=full)
    assert done.returncode == 1
    assert done.stderr == b"error: standard output: cannot be written: No space left on device\n"


@pytest.mark.parametrize(
    ("arguments", "text"),
    [(("render", "--help"), b"omnisim render"), (("sensor", "--check", "a.toml"), rb"\u03be = ")],
)
def test_console_without_unicode(tmp_path, arguments, text):
    (tmp_path / "a.toml").write_text("# defaults", encoding="utf-8")
    done = run(tmp_path, *arguments, encoding="ascii", stdout=subprocess.PIPE)
    assert (done.returncode, done.stderr, text in done.stdout) == (0, b"", True)
    assert done.stdout.isascii()


def test_working_directory_that_is_gone(tmp_path):
    gone = tmp_path / "gone"
    gone.mkdir()
    code = f"import os\nos.rmdir({str(gone)!r})\nfrom omnisim.apps.cli.start import main\nmain()"
    done = subprocess.run(
        [sys.executable, "-c", code, "render", "rings", "--size", "24", "-o", "a.png"],
        cwd=gone, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 1
    assert done.stderr == "error: the working directory no longer exists\n"


def test_cut_png_is_one_line(tmp_path):
    """libpng prints lines of its own."""
    write_image(tmp_path / "a.png", np.random.default_rng(0).integers(0, 255, (64, 64, 3), "u1"))
    data = (tmp_path / "a.png").read_bytes()
    (tmp_path / "a.png").write_bytes(data[: len(data) // 2])
    done = run(tmp_path, "unwarp", "a.png", "--to", "cylinder", "-o", "b.png")
    assert done.returncode == 1
    assert done.stderr == b"error: a.png: cannot be read: the file is cut off\n"
