"""`omnisim serve`: what it refuses, in one line each."""

import re
import socket

import pytest

from omnisim.core import extras
from tests.apps.cli.runs.test_drive import DRIVE

BLIND = """
name = "blind"

[[sensors]]
name = "imu"
type = "imu"
position_m = [0.0, 0.0, 0.1]
"""
WHEELS = """
[kinematics]
type = "differential"
max_speed_mps = 1.0
max_turn_rate_degps = 90.0
max_acceleration_mps2 = 0.5
max_turn_acceleration_degps2 = 90.0
"""


@pytest.fixture
def robots(tmp_path):
    """Robots without and with kinematic limits."""
    pytest.importorskip("rosbags", reason="rosbags is not installed")
    (tmp_path / "blind.toml").write_text(BLIND)
    (tmp_path / "robot.toml").write_text(BLIND + WHEELS)


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ("blind.toml", "robot 'blind': expected [kinematics], to be driven by commands"),
        ("robot.toml robot.toml", "robot 'robot.toml': a second blind: expected NAME=robot.toml"),
        ("robot.toml --also rnage", "--also rnage: did you mean 'range'?"),
        ("robot.toml --protocols plian", "--protocols plian: did you mean 'plain'?"),
        ("robot.toml --protocols plain --router tcp/a:1",
         "--router: expected ros2 among --protocols"),
        ("robot.toml --fast --lockstep", "--fast, --lockstep: expected one of them"),
        ("robot.toml --protocols plain --record a.bag", "a.bag: expected a name that ends in "
         ".mcap"),
        ("robot.toml --commands a.txt", "a.txt: expected a name that ends in .csv"),
        ("robot.toml --commands /proc/a.csv", "/proc/a.csv: the folder /proc cannot be written to"),
        ("robot.toml --at 1e300 0",
         "robot 'blind': start: x_m = 1e+300: expected a finite number below 1e+15"),
        ("robot.toml --at nan 0",
         "robot 'blind': start: x_m = nan: expected a finite number below 1e+15"),
    ],
)  # fmt: skip
def test_bad_requests_are_one_line(refused, robots, words, line):
    assert refused("serve", *words.split()) == line


def test_a_duration_of_nothing_is_one_line(omnisim, robots):
    status, out, error = omnisim("serve", "robot.toml", "--duration", 0)
    assert (status, out, error.count("\n")) == (2, "", 1)
    assert error.startswith("error: --duration: expected a number of seconds from 0.01 ")


def test_a_missing_extra_is_one_line(refused, robots, monkeypatch):
    monkeypatch.setattr(extras, "is_installed", lambda module: module != "rosbags")
    line = refused("serve", "robot.toml")
    assert re.fullmatch(r"omnisim serve needs rosbags: pip install \S+\[ros\]\S*", line)


@pytest.mark.slow
def test_what_is_taken_is_one_line(omnisim, robots, needs_opengl, tmp_path):
    """A port, an address elsewhere, and a file: known only once the sensors are open."""
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        words = ["serve", "robot.toml", "--protocols", "plain", "--host", "127.0.0.1"]
        status, out, error = omnisim(*words, "--port", port)
    assert (status, out) == (1, "")
    assert re.fullmatch(rf"error: --port {port}: cannot listen on 127.0.0.1: .+\n", error)
    words[-1] = "192.0.2.1"
    status, out, error = omnisim(*words, "--port", 0)
    assert (status, out) == (1, "")
    assert re.fullmatch(r"error: --port 0: cannot listen on 192.0.2.1: .+\n", error)
    pytest.importorskip("foxglove", reason="foxglove-sdk is not installed")
    (tmp_path / "there.mcap").write_bytes(b"kept")
    words[-1] = "127.0.0.1"
    status, out, error = omnisim(*words, "--port", 0, "--record", "there.mcap")
    line = "error: there.mcap: already exists; choose a new name for the recording\n"
    assert (status, out, error) == (1, "", line)
    assert (tmp_path / "there.mcap").read_bytes() == b"kept"


@pytest.mark.slow
def test_a_run_that_is_not_finished_is_one_line(omnisim, quiet, needs_opengl, tmp_path):
    pytest.importorskip("rosbags", reason="rosbags is not installed")
    quiet(*DRIVE, "-o", "run")
    words = ["serve", "run", "--protocols", "plain", "--port", 0, "--fast"]
    status, out, error = omnisim(*words)
    assert (status, error) == (0, "")
    assert "topics of run" in out
    (tmp_path / "run" / "omnicam" / "000001.png").unlink()
    line = "error: run/omnicam/000001.png: is missing: expected a finished run: [^\n]+\n"
    status, out, error = omnisim(*words)
    assert (status, out) == (1, "")
    assert re.fullmatch(line, error)
    for option in ("--seed", "--rate", "--timeout"):
        _, _, error = omnisim("serve", "run", option, 1)
        assert re.match(rf"error: {option}: expected none with a run", error)
