"""Drives with lidars: what they leave on disk, and gone on with after they stop."""

import itertools
import json
import shutil

import numpy as np
import pytest
import trimesh

from omnisim.core.errors import RobotFileError
from omnisim.core.trajectories import read_trajectory
from omnisim.robots.vehicle import Vehicle
from omnisim.runs.drive import Drive
from omnisim.runs.route import Route
from omnisim.scene import load_scene
from tests.runs.test_drive import _bytes
from tests.slow import slow_but

LIDAR = """
name = "scout"

[kinematics]
type = "differential"
track_m = 0.4
wheel_diameter_m = 0.2
max_speed_mps = 1.0
max_turn_rate_degps = 90.0
max_acceleration_mps2 = 0.5
max_turn_acceleration_degps2 = 180.0

[footprint]
length_m = 0.5
width_m = 0.4
height_m = 0.5

[[sensors]]
name = "lidar"
type = "lidar"
position_m = [0.1, 0.0, 0.6]
firings = 120
{keys}
"""


def _vehicle(folder, keys=""):
    (folder / "robot.toml").write_text(LIDAR.format(keys=keys))
    return Vehicle.load(folder / "robot.toml")


@pytest.mark.usefixtures("needs_opengl")
@pytest.mark.parametrize("suffix", slow_but(["ply", "pcd"], long=["ply"]))
def test_a_stopped_drive_goes_on_with_the_same_bytes(tmp_path, suffix):
    vehicle = _vehicle(tmp_path, f'file_format = "{suffix}"')
    drive = Drive(load_scene("soccer"), vehicle, Route("lap", step_m=1.5), seed=3)
    whole, run = tmp_path / "whole", tmp_path / "run"
    steps = list(drive.plan().record(whole))[-1]
    names = {f"{step:06d}.{suffix}" for step in range(steps)}
    assert {file.name for file in (whole / "lidar").iterdir()} == names
    assert (whole / "labels.json").is_file()
    recording = drive.plan().record(run)
    for _ in range(3):
        next(recording)
    recording.close()
    assert len(list((run / "lidar").iterdir())) == 2
    (run / "lidar" / f"000001.{suffix}").write_bytes(b"")  # by a power cut
    assert list(drive.plan().record(run)) == list(range(1, steps + 1))
    assert _bytes(run) == _bytes(whole)
    shutil.rmtree(run / "lidar")
    (run / "lidar").mkdir()
    list(drive.plan().record(run))
    assert _bytes(run) == _bytes(whole)


@pytest.mark.usefixtures("needs_opengl")
def test_a_cloud_has_its_revolution_its_pose_and_known_instances(tmp_path):
    route = Route("lap", step_m=6.0, step_deg=90.0)
    plan = Drive(load_scene("soccer"), _vehicle(tmp_path), route).plan()
    steps = plan.record(tmp_path / "run")
    list(itertools.islice(steps, 4))  # the first three
    steps.close()
    truth = read_trajectory(tmp_path / "run" / "ground_truth.tum")
    path = tmp_path / "run" / "lidar" / "000002.ply"
    header = path.read_bytes().partition(b"end_header")[0].decode("ascii")
    comments = {
        key: json.loads(value)
        for line in header.splitlines()
        if line.startswith("comment ")
        for key, value in [line.removeprefix("comment ").split(": ", 1)]
    }
    assert comments["revolution"] == 2
    assert comments["time_s"] == pytest.approx(truth.times_s[2])
    at_start = plan.motion.pose_at(comments["time_s"] - 0.1)
    for key, world_from_base in (
        ("world_from_lidar", truth.world_from_base[2]),
        ("world_from_lidar_at_start", at_start),
    ):
        expected = world_from_base @ [[1, 0, 0, 0.1], [0, 1, 0, 0], [0, 0, 1, 0.6], [0, 0, 0, 1]]
        np.testing.assert_allclose(comments[key], expected, atol=1e-6)
    values = trimesh.load(path).metadata["_ply_raw"]["vertex"]["data"]
    labels = json.loads((tmp_path / "run" / "labels.json").read_text())
    ids = {entry["id"] for entry in labels["instances"]}
    assert set(np.asarray(values["instance"]).ravel().tolist()) <= ids


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ('device = "vlp32"', "device: expected 'vlp16' or 'hdl64e', got 'vlp32'"),
        ('file_format = "las"', "file_format: expected 'ply' or 'pcd', got 'las'"),
        ("elevations_deg = [1, 1]", r"elevations_deg: expected rising angles, got \(1.0, 1.0\)"),
        ("elevations_deg = [85]", "elevations_deg.*85"),
        ("range_min_m = 200", "range_min_m: expected less than range_max_m = 100, got 200"),
        ("returns = 3", "returns: expected .*2, got 3"),
        ("specular = 1", "specular: expected true or false"),
    ],
)
def test_lidars_that_cannot_be_mounted(tmp_path, keys, words):
    with pytest.raises(RobotFileError, match=words) as caught:
        _vehicle(tmp_path, keys)
    assert str(caught.value).startswith(f"{tmp_path / 'robot.toml'}: sensor 'lidar': ")
    assert "\n" not in str(caught.value)


def test_a_lidar_by_its_keys(tmp_path):
    (mount,) = _vehicle(tmp_path, "returns = 2\nmin_intensity = 0.3\nspecular = false").sensors
    lidar = mount.sensor
    assert (lidar.returns, lidar.min_intensity, lidar.specular) == (2, 0.3, False)
    (sensor,) = _vehicle(tmp_path, "noise = false\nsigma_m = 0.5").sensors
    assert sensor.sensor.sigma_m == 0.0
    assert sensor.sensor.step_m == 0.002
    assert sensor.summary() == "16 rings × 120 firings at 10 Hz to 100 m"
