"""`omnisim sensor --check` and runs, of sensors with optical systems."""

import shutil
from pathlib import Path

import numpy as np
import pytest

import omnisim as package
from omnisim import OmniCamera
from omnisim.cameras.optics import read_optics_file
from omnisim.core.trajectories import Trajectory, write_trajectory
from omnisim.rendering.camera.captured_image import read_captured_image

EXAMPLES = Path(package.__file__).parents[1] / "examples" / "optics"
IN_PLACE = """
[optics]
looking = [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]
[optics.mounting]
position_m = [0.0, 0.0, 0.1]
[optics.camera]
model = "perspective"
width_px = 36
height_px = 36
focal_length_px = 80.0
[[optics.surfaces]]
shape = "table"
r_m = [0.0, 0.005, 0.01, 0.015, 0.02]
z_m = [0.0, 0.0005, 0.002, 0.0045, 0.008]
position_m = [0.0, 0.0, 0.15]
"""


@pytest.fixture
def systems(tmp_path):
    """Sensor files: a.toml names an optics file, b.toml has the system in place."""
    for suffix in ("toml", "csv"):
        shutil.copy(EXAMPLES / f"equi-angular.{suffix}", tmp_path)
    text = '[optics]\nfile = "equi-angular.toml"\npolygons = "auto"\n'
    (tmp_path / "a.toml").write_text(text)
    (tmp_path / "b.toml").write_text(IN_PLACE)
    return tmp_path


@pytest.mark.usefixtures("systems")
def test_check_prints_a_line_for_each_part(ran):
    out, _ = ran("sensor", "--check", "a.toml")
    assert "shape = table, r_m = 501 values, z_m = 501 values, tip = smooth" in out
    out, _ = ran("sensor", "--check", "b.toml")
    assert "looking" in out
    assert "r_m = [0.0, 0.005, 0.01, 0.015, 0.02]" in out


@pytest.mark.usefixtures("needs_opengl")
@pytest.mark.parametrize(
    "options",
    [("--sensor", "sensor.toml"), ("--optics", "optics.toml", "--preset", "webcam")],
)
def test_trajectories(ran, tmp_path, options):
    (tmp_path / "sensor.toml").write_text(IN_PLACE)
    shutil.copy(EXAMPLES / "dome-port.toml", tmp_path / "optics.toml")
    poses = np.array([np.eye(4), np.eye(4)])
    poses[:, :3, 3] = (0.0, 0.0, 1.0), (0.2, 0.0, 1.0)
    write_trajectory(tmp_path / "poses.tum", Trajectory(np.array([0.0, 0.5]), poses))
    command = ("record", "soccer", *options, "--trajectory", "poses.tum", "--size", 36, "-o", "run")
    ran(*command)
    taken = read_captured_image(tmp_path / "run" / "camera" / "000001.png")
    again = OmniCamera.from_file(tmp_path / "run" / "camera" / "sensor.toml")
    assert taken.camera.parameters() == again.model.parameters()
    first = tmp_path / "run" / "camera" / "000000.png"
    before = first.read_bytes()
    first.unlink()
    ran(*command)
    assert first.read_bytes() == before


def test_either_file_is_the_system(ran, systems):
    """Sensor files where optics files go, and optics files where sensor files do."""
    system = read_optics_file(systems / "equi-angular.toml")
    for read in (
        read_optics_file(systems / "a.toml"),
        OmniCamera.of(systems / "equi-angular.toml").model,
        OmniCamera.from_file(systems / "a.toml").model,
    ):
        assert read.parameters() == system.parameters()
    in_place = OmniCamera.from_file(systems / "b.toml").model
    assert read_optics_file(systems / "b.toml").parameters() == in_place.parameters()
    assert OmniCamera.of(systems / "equi-angular.toml").polygons is None
    assert "36 × 36 px, 1 mirror" in ran("optics", "check", "b.toml")[0]


def test_a_sensor_file_that_names_itself_is_no_optics_file(omnisim, tmp_path):
    (tmp_path / "a.toml").write_text('[optics]\nfile = "a.toml"\n')
    for command in (("sensor", "--check", "a.toml"), ("optics", "check", "a.toml")):
        assert "error: a.toml: camera: missing" in omnisim(*command)[2]
