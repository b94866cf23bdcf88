"""The command starts quickly: nothing is imported that the work at hand does not need."""

import gc
import subprocess
import sys

import pytest

from omnisim.cli.app import main

# What only others need: plots, reports, other formats than glTF, oracles.
SELDOM = (
    "trimesh", "networkx", "matplotlib", "jinja2", "collada", "yaml", "av", "cv2", "mitsuba",
    "pyrender", "pycolmap",
)  # fmt: skip
# The same of our own: built of many tables, of which the paper's camera needs none.
SELDOM_OURS = ("omnisim.calibration", "omnisim.plots", "omnisim.sensors.sensor_file")


@pytest.mark.usefixtures("needs_opengl")
def test_a_picture_needs_nothing_that_only_others_need(tmp_path):
    _run(tmp_path, SELDOM + SELDOM_OURS, "render", "rings", "--size", "24", "-o", "a.png")
    assert (tmp_path / "a.png").is_file()


@pytest.mark.usefixtures("needs_opengl")
def test_a_drive_needs_nothing_that_only_others_need(tmp_path):
    _run(
        tmp_path, SELDOM, "drive", "soccer", "--robot", "superscout", "--path", "lap_clockwise",
        "--size", "24", "--quality", "fast", "--step", "3", "--turn-step", "90", "-o", "run",
    )  # fmt: skip
    assert (tmp_path / "run" / "omnicam" / "000000.png").is_file()


def test_an_error_is_one_line_even_when_the_process_has_ended():
    code = (
        "import sys\nfrom omnisim.cli.app import main\n"
        "sys.argv = ['omnisim', 'render', 'ringz', '-o', 'a.png']\nmain()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.startswith("error: ringz: no such scene file")
    assert len(done.stderr.splitlines()) == 1


def test_nothing_stays_frozen_in_a_process_that_goes_on(monkeypatch):
    before = gc.get_freeze_count()
    monkeypatch.setattr("sys.argv", ["omnisim", "--version"])
    with pytest.raises(SystemExit):
        main()
    assert gc.get_freeze_count() <= before


def _run(folder, seldom, *arguments):
    """The command in a process of its own, which must not import any of `seldom`."""
    code = (
        "import sys\n"
        "from omnisim.cli.app import main\n"
        f"sys.argv = {['omnisim', *arguments]!r}\n"
        "try:\n    main()\nexcept SystemExit as stopped:\n    assert not stopped.code\n"
        f"found = set({seldom!r}) & set(sys.modules)\n"
        "sys.exit(f'imported: {sorted(found)}' if found else 0)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert not done.stderr  # nor does a library say anything when the process ends
