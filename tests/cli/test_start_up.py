"""The command starts quickly: nothing is imported that the work at hand does not need."""

import subprocess
import sys

import pytest

# What only others need: fits and statistics, plots, reports, other formats than glTF, oracles.
SELDOM = (
    "scipy", "matplotlib", "jinja2", "trimesh", "networkx", "collada", "yaml", "av", "cv2",
    "mitsuba", "pyrender", "pycolmap",
)  # fmt: skip
# The same of our own: built of many tables, of which the paper's camera needs none.
SELDOM_OURS = ("omnisim.calibration", "omnisim.plots", "omnisim.sensors.sensor_file")


@pytest.mark.usefixtures("needs_opengl")
def test_a_picture_needs_nothing_that_only_others_need(tmp_path):
    code = (
        "import sys\n"
        "from omnisim.cli.app import main\n"
        "sys.argv = ['omnisim', 'render', 'rings', '--size', '24', '-o', 'a.png']\n"
        "try:\n    main()\nexcept SystemExit as stopped:\n    assert not stopped.code\n"
        f"found = set({(*SELDOM, *SELDOM_OURS)!r}) & set(sys.modules)\n"
        "sys.exit(f'imported: {sorted(found)}' if found else 0)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "a.png").is_file()
