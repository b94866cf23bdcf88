"""Start-up of the command: no module is imported that the command does not need."""

import subprocess
import sys

import pytest

from omnisim.core.version import __version__
from omnisim.rendering.camera.sensor_file import DEFAULT_SENSOR_FILE

# What only others need: plots, reports, other formats than glTF, oracles.
RARE_LIBRARIES = (
    "trimesh", "networkx", "matplotlib", "jinja2", "collada", "yaml", "av", "cv2", "mitsuba",
    "pyrender", "pycolmap", "embreex",
)  # fmt: skip
# Modules of other commands: large tables that the paper's camera does not need.
RARE_MODULES = (
    "omnisim.cameras.calibration", "omnisim.plots", "omnisim.rendering.rays",
    "omnisim.rendering.camera.sensor_file",
)  # fmt: skip
# Not needed by an ideal image without textures and ground truth.
RARE_IN_IMAGES = (
    "PIL", "rich", "scipy", "typer",
    "omnisim.cameras.camera_registry", "omnisim.cameras.models",
    "omnisim.core.trajectories", "omnisim.rendering.truth",
    "omnisim.rendering.camera.degradations.degradation_file",
    "omnisim.rendering.camera.degradations.noise",
    "omnisim.rendering.opengl.degradation.degradation_pass",
    "omnisim.rendering.opengl.hits",
)  # fmt: skip


@pytest.mark.usefixtures("needs_opengl")
def test_a_image_imports_nothing_of_other_commands(tmp_path):
    rare = RARE_LIBRARIES + RARE_MODULES + RARE_IN_IMAGES
    _run(tmp_path, rare, "render", "rings", "--size", "24", "-o", "a.png")
    assert (tmp_path / "a.png").is_file()


def test_a_sensor_file_is_checked_without_scenes_images_and_graphics(tmp_path):
    (tmp_path / "sensor.toml").write_bytes(DEFAULT_SENSOR_FILE.read_bytes())
    rare = (
        "moderngl", "OpenImageIO", "PIL", "omnisim.scene", "omnisim.core.files.image_files",
        "omnisim.rendering.opengl.gl.context", "omnisim.rendering.stage", "omnisim.ground_truth",
    )  # fmt: skip
    _run(tmp_path, RARE_LIBRARIES + rare, "sensor", "--check", "sensor.toml")


@pytest.mark.usefixtures("needs_opengl")
def test_a_drive_imports_nothing_of_other_commands(tmp_path):
    (tmp_path / "way.csv").write_text("x_m,y_m\n0,0\n1,0\n")
    _run(
        tmp_path, RARE_LIBRARIES, "drive", "compass", "--robot", "superscout", "--path", "way.csv",
        "--size", "16", "--quality", "fast", "--ground", "0", "-o", "run",
    )  # fmt: skip
    assert (tmp_path / "run" / "omnicam" / "000000.png").is_file()


def test_an_error_is_one_line_after_the_process_has_ended():
    code = (
        "import sys\nfrom omnisim.apps.cli.app import main\n"
        "sys.argv = ['omnisim', 'render', 'ringz', '-o', 'a.png']\nmain()"
    )
    done = _python(code)
    assert done.returncode == 1
    assert done.stderr.startswith("error: ringz: no such scene file")
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("later", ["atexit.register(print, 'later')", "THREAD.start()"])
def test_what_is_to_run_at_exit_runs(later):
    """Although the command leaves its memory to the operating system."""
    code = (
        "import atexit, sys\nfrom threading import Timer\nfrom omnisim.apps.cli import app, start\n"
        "THREAD = Timer(1.0, print, ['later'])\n"
        f"def main():\n    {later}\n    print('now')\n    sys.exit(3)\n"
        "app.main = main\nstart.main()"
    )
    done = _python(code)
    assert (done.returncode, done.stderr) == (3, "")
    assert done.stdout.splitlines() == ["now", "later"]


def test_the_memory_is_left_to_the_operating_system():
    code = (
        "import sys\nfrom omnisim.apps.cli.start import main\n"
        "class Big:\n    def __del__(self):\n        print('freed')\n"
        "big = Big()\nsys.argv = ['omnisim', '--version']\nmain()"
    )
    done = _python(code)
    assert (done.returncode, done.stdout) == (0, f"omnisim {__version__}\n")


def _run(folder, rare, *arguments):
    """The command in a process of its own, which must not import any of `rare`."""
    code = (
        "import sys\n"
        "from omnisim.apps.cli.app import main\n"
        f"sys.argv = {['omnisim', *arguments]!r}\n"
        "try:\n    main()\nexcept SystemExit as stopped:\n    assert not stopped.code\n"
        f"found = set({rare!r}) & set(sys.modules)\n"
        "sys.exit(f'imported: {sorted(found)}' if found else 0)"
    )
    done = _python(code, folder)
    assert done.returncode == 0, done.stderr
    assert not done.stderr  # nor does a library say anything when the process ends


def _python(code, folder=None):
    return subprocess.run(
        [sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=False
    )
