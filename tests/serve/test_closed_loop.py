"""The example's controller drives a served robot round the field's lap by what it sees.

Server and controller have a process each; the test watches by a client of its own.
"""

import itertools
import os
import socket
import subprocess
import sys

import numpy as np
import pytest
from click.testing import CliRunner

pytest.importorskip("rosbags", reason="rosbags is not installed")

from omnisim.apps.cli.app import app
from omnisim.scene import read_scene
from omnisim.serve import connect
from tests.serve.server_process import ROOT, serving

pytestmark = [pytest.mark.slow, pytest.mark.long, pytest.mark.usefixtures("needs_opengl")]
RATE_HZ = 2.0
IMAGE = ("--size", "240", "--quality", "fast")
MAX_OFF_M = 0.15
# Runs the example beside definitions of messages, which the SDK would clone from GitHub.
AS_NODE = """
import pathlib, runpy, sys
from zenoh_ros2_sdk import ZenohSession
from zenoh_ros2_sdk.message_registry import get_registry
from tests.serve.ros_client import write_definitions
del sys.argv[0]
write_definitions(".")
ZenohSession.get_instance(router_port=int(sys.argv[-3]))
get_registry().messages_dir = pathlib.Path()
runpy.run_path(sys.argv[0], run_name="__main__")
"""


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    """Colors of the landmarks, learned across the field."""
    folder = tmp_path_factory.mktemp("colors")
    (folder / "way.csv").write_text("x_m,y_m\n-2.3,-1.5\n2.0,1.3\n")
    run, colors = folder / "run", folder / "colors.npz"
    drive = ("drive", "soccer", "--robot", "p2at", "--path", folder / "way.csv", "--step", 1.5)
    for words in (
        (*drive, "--turn-step", 90, *IMAGE, "--also", "instance", "-o", run),
        ("landmarks", "train", run, "-o", colors),
    ):
        done = CliRunner().invoke(app, [str(word) for word in words])
        assert done.exit_code == 0, done.output
    return colors


def _free_port():
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


def _off_m(points_m, lap_m):
    """Distances (n,) of points (n, 2) from the line through waypoints (m, 2)."""
    distances_m = []
    for begin, end in itertools.pairwise(lap_m):
        leg = end - begin
        along = np.clip((points_m - begin) @ leg / (leg @ leg), 0.0, 1.0)
        distances_m.append(np.linalg.norm(points_m - begin - along[:, None] * leg, axis=1))
    return np.min(distances_m, axis=0)


@pytest.mark.parametrize("protocol", ["plain", "ros2"])
def test_a_controller_drives_the_lap_by_what_it_sees(protocol, model, tmp_path):
    words = ["p2at", "--scene", "soccer", "--lockstep", "--rate", RATE_HZ, *IMAGE]
    start = [str(ROOT / "examples/serve_controller.py"), str(model), "--step", str(1.0 / RATE_HZ)]
    if protocol == "ros2":
        pytest.importorskip("zenoh", reason="needs the extra zenoh")
        pytest.importorskip("zenoh_ros2_sdk", reason="needs zenoh-ros2-sdk")
        port = str(_free_port())
        words += ["--protocols", "plain,ros2", "--router", f"tcp/127.0.0.1:{port}"]
        start = ["-c", AS_NODE, *start, "--ros2", port]
    else:
        words += ["--protocols", "plain"]
    with (
        serving(tmp_path, *words) as address,
        connect(address, topics=["/ground_truth/odom"]) as watcher,
    ):
        start += ["--address", address]
        done = subprocess.run(
            [sys.executable, "-W", "error", *start], cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(ROOT)}, stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT, text=True, check=False,
        )  # fmt: skip
        poses = []
        while (message := watcher.next(1.0)) is not None:
            poses.append(message.fields["pose"]["pose"]["position"])
    assert done.returncode == 0, done.stdout
    points_m = np.array([(pose["x"], pose["y"]) for pose in poses])
    (lap,) = (path for path in read_scene("soccer").paths if path.name == "lap_clockwise")
    lap_m = np.array(lap.waypoints_m[:5])  # round the field, without the way across
    assert _off_m(points_m, lap_m).max() <= MAX_OFF_M
    from_corners_m = np.linalg.norm(points_m - lap_m[1:, None], axis=2)
    assert from_corners_m.min(axis=1).max() <= MAX_OFF_M
    assert np.all(np.diff(from_corners_m[:3].argmin(axis=1)) > 0)
    assert from_corners_m[-1, -1] <= MAX_OFF_M  # back at the start
