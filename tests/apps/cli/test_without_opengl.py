"""Back end of rays where moderngl cannot be imported, as where OpenGL does not exist."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from omnisim import OmniCamera, open_sensor
from omnisim.core.files.image_files import read_image

OPTICS = Path(__file__).resolve().parents[3] / "examples" / "optics"
REFUSAL = "needs moderngl: pip install 'omnisim-camera[opengl]'; back end 'rays' needs no OpenGL\n"
# Before all else: neither can be imported.
BLOCKED = "import sys\nsys.modules['moderngl'] = sys.modules['glcontext'] = None\n"
PROGRAM = """
import numpy as np
import omnisim
camera = omnisim.OmniCamera().resized(32)
with omnisim.open_sensor("courtyard", camera, backend="rays") as renderer:
    pose = camera.base_pose((0.0, 0.0, 1.0), yaw_deg=30.0)
    frame = renderer.render(pose, also=("range", "instance"))
np.savez("frame.npz", rgb=frame.rgb, valid=frame.valid, **frame.channels)
from omnisim.sensors import DepthCamera, LaserScanner, RangeSensor, SpinningLidar
from omnisim.rendering import Stage
from omnisim.core.poses import pose
base = pose((0.0, 0.0, 1.0))
with Stage("courtyard", backend="rays") as stage:
    with stage.open(LaserScanner()) as laser:
        assert np.isfinite(laser.scan(base).ranges_m).any()
    with stage.open(SpinningLidar()) as lidar:
        assert len(lidar.scan(base).points_m)
    with stage.open(RangeSensor()) as sonar:
        sonar.measure(base)
    with stage.open(DepthCamera()) as depth:
        assert np.isfinite(depth.measure(base).depths_m).any()
"""
COMMANDS = """
from omnisim.apps.cli.app import main
for command in sys.argv[1:]:
    sys.argv = ["omnisim", *command.split()]
    try:
        main()
    except SystemExit as stopped:
        if stopped.code:
            raise
"""


def _run(folder, code, *arguments):
    """Run code in a process that has no moderngl."""
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", BLOCKED + code, *arguments],
        cwd=folder, capture_output=True, text=True, check=False,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("command", "what"),
    [("render courtyard -o a.png", "back end 'cube'"), ("info", "the list of devices")],
)
def test_what_draws_by_opengl_ends_in_one_line(omnisim, monkeypatch, command, what):
    monkeypatch.setitem(sys.modules, "moderngl", None)
    status, _, error = omnisim(*command.split())
    assert (status, error) == (1, f"error: {what} {REFUSAL}")


@pytest.mark.slow
def test_the_courtyard_is_rendered_with_ground_truth_and_other_sensors_measure(tmp_path):
    pytest.importorskip("embreex")
    _run(tmp_path, PROGRAM)
    without = np.load(tmp_path / "frame.npz")
    camera = OmniCamera().resized(32)
    with open_sensor("courtyard", camera, backend="rays") as renderer:
        pose = camera.base_pose((0.0, 0.0, 1.0), yaw_deg=30.0)
        frame = renderer.render(pose, also=("range", "instance"))
    expected = {"rgb": frame.rgb, "valid": frame.valid, **frame.channels}
    assert without.files == list(expected)
    for name, values in expected.items():
        np.testing.assert_array_equal(without[name], values)


@pytest.mark.slow
def test_commands_render_drive_scan_and_describe(tmp_path):
    pytest.importorskip("embreex")
    _run(
        tmp_path, COMMANDS,
        "render courtyard --size 32 --backend rays --also range,instance -o a.exr",
        "render soccer --size 32 --preset webcam --backend rays -o b.png",
        f"render rings --optics {OPTICS / 'sphere.toml'} --size 32 --backend rays -o c.png",
        "scene courtyard",
        "drive soccer --robot superscout --path lap_clockwise --step 3 --turn-step 90 --size 24 "
        "--backend rays -o run",
    )  # fmt: skip
    _, metadata = read_image(tmp_path / "a.exr")
    assert metadata["scene"] == "courtyard"
    for name in ("b.png", "c.png", "run/omnicam/000000.png"):
        assert (tmp_path / name).is_file()
