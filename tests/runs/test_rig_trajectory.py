"""Poses of a file as poses of a rig's body, in each format's convention."""

import json
from pathlib import Path

import numpy as np
import pytest

from omnisim.cameras import PerspectiveCamera
from omnisim.cameras.calibration import load_calibration
from omnisim.cameras.calibration.calibration import Rig, RigCamera
from omnisim.core.coordinate_frames import BASE_FROM_OPTICAL_LOOKING_AHEAD
from omnisim.core.errors import OmnisimError
from omnisim.core.poses import inverse, pose, pose_from_rotation
from omnisim.core.trajectories import Trajectory, write_trajectory
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.runs.rig_trajectory import RigRoute

SAMPLES = Path(__file__).parents[1] / "cameras" / "calibration" / "samples"
LENS = PerspectiveCamera(64, 48, 40.0, (31.5, 23.5))
AHEAD = pose_from_rotation(BASE_FROM_OPTICAL_LOOKING_AHEAD, np.zeros(3))
IMU_FROM_CAMERA = pose((0.1, -0.2, 0.3), roll_deg=10.0, pitch_deg=20.0, yaw_deg=30.0)
ON_IMU = Rig("imu", (RigCamera("cam0", LENS, IMU_FROM_CAMERA),))
BARE = Rig("cam0", (RigCamera("cam0", LENS, np.eye(4)),))
POSES = np.array(
    [
        pose((1.0, 2.0, 0.5), roll_deg=5.0, pitch_deg=-10.0, yaw_deg=40.0),
        pose((1.5, 2.0, 0.6), pitch_deg=3.0, yaw_deg=50.0),
    ]
)
TIMES_S = np.array([0.25, 0.75])


@pytest.fixture
def write(tmp_path):
    def in_format(name):
        path = tmp_path / f"poses.{name}"
        axes = "world" if name == "kitti" else None  # the numbers as they are
        write_trajectory(path, Trajectory(TIMES_S, POSES), name, axes)
        return path

    return in_format


def _read(path, rig, **settings):
    notes = []
    trajectory, is_timed = RigRoute(path, **settings).read(rig, notes.append)
    return trajectory.world_from_base, is_timed, notes


@pytest.mark.parametrize("name", ["tum", "euroc", "csv"])
def test_poses_are_the_bodys_or_the_first_cameras_where_the_rig_has_no_body(write, name):
    poses, is_timed, notes = _read(write(name), ON_IMU)
    np.testing.assert_allclose(poses, POSES, atol=1e-8)
    assert is_timed
    assert len(notes) == 1
    assert "poses of the rig's imu" in notes[0]
    if name != "csv":
        poses, _, notes = _read(write(name), BARE)
        np.testing.assert_allclose(poses, POSES, atol=1e-8)
        assert "poses of cam0 (x right, y down, z forward)" in notes[0]


def test_headings_are_those_of_a_vehicle_that_the_camera_looks_ahead_on(write):
    poses, _, notes = _read(write("csv"), BARE)
    np.testing.assert_allclose(poses, POSES @ AHEAD, atol=1e-8)
    assert "a vehicle (x forward, y left, z up) with cam0 on it" in notes[0]


def test_kittis_poses_are_the_first_cameras_in_a_world_with_y_down(write):
    poses, is_timed, notes = _read(write("kitti"), ON_IMU)
    np.testing.assert_allclose(poses @ IMU_FROM_CAMERA, AHEAD @ POSES, atol=1e-8)
    assert not is_timed
    assert "poses of cam0 (x right, y down, z forward), in KITTI's axes" in notes[0]
    assert "has no times: 1 pose per second" in notes[1]


def test_kittis_poses_set_a_mirror_upright(write):
    mirror = OmniCamera()
    rig = Rig("base", (RigCamera("camera", mirror.model, mirror.base_from_optical),))
    poses, _, notes = _read(write("kitti"), rig)
    np.testing.assert_allclose(poses, AHEAD @ POSES @ inverse(AHEAD), atol=1e-8)  # as a drive
    assert "a camera that looks ahead from the position of camera" in notes[0]


def test_the_user_may_say_otherwise(write):
    poses, is_timed, notes = _read(write("kitti"), ON_IMU, frame="body", axes="world", rate_hz=10.0)
    np.testing.assert_allclose(poses, POSES, atol=1e-8)
    assert is_timed
    assert not notes
    poses, _, _ = _read(write("tum"), ON_IMU, frame="cam0")
    np.testing.assert_allclose(poses @ IMU_FROM_CAMERA, POSES, atol=1e-8)


def test_the_files_origin_is_placed_in_the_scene(write):
    placed = pose((0.0, 0.0, 1.65), yaw_deg=90.0)
    poses, _, _ = _read(write("tum"), ON_IMU, world_from_file=placed)
    np.testing.assert_allclose(poses, placed @ POSES, atol=1e-8)


def test_nerfstudios_frames_are_the_cameras_in_opengls_axes():
    path = SAMPLES / "transforms.json"
    rig = Rig.of(load_calibration(path))
    poses, _, notes = _read(path, rig)
    # its second frame: right is +y, up is +z, and the camera looks along −x: −z of the file's
    np.testing.assert_allclose(poses[1, :3, 0], (0.0, 1.0, 0.0))
    np.testing.assert_allclose(poses[1, :3, 1], (0.0, 0.0, -1.0))
    np.testing.assert_allclose(poses[1, :3, 2], (-1.0, 0.0, 0.0))
    np.testing.assert_allclose(poses[1, :3, 3], (1.5, -2.0, 1.25))
    assert "poses of camera (x right, y down, z forward)" in notes[0]


def test_frames_of_several_cameras_are_those_of_the_one_taken(tmp_path):
    content = json.loads((SAMPLES / "transforms.json").read_text())
    content["frames"][1]["fl_x"] = 900.0
    path = tmp_path / "transforms.json"
    path.write_text(json.dumps(content))
    calibration = load_calibration(path)
    second = calibration.names[1]
    poses, _, _ = _read(path, Rig.of(calibration, second))
    np.testing.assert_allclose(poses[:, :3, 3], [(1.5, -2.0, 1.25)])
    with pytest.raises(OmnisimError, match=r"2 cameras with intrinsics of their own"):
        _read(path, ON_IMU)


@pytest.mark.parametrize(
    ("name", "settings", "words"),
    [
        ("tum", {"frame": "cam7"}, "--trajectory-frame 'cam7': expected one of body, camera, cam0"),
        ("tum", {"frame": "odom"}, "--trajectory-frame 'odom': expected one of body, camera, cam0"),
        ("tum", {"rate_hz": 10.0}, "has times of its own: expected no --rate"),
        ("kitti", {"rate_hz": -1.0}, "--rate: expected a finite number above 0, got -1"),
        ("csv", {"axes": "kitti"}, "--axes: expected world, got kitti"),
    ],
)
def test_what_cannot_be_is_refused(write, name, settings, words):
    with pytest.raises(OmnisimError) as fault:
        _read(write(name), ON_IMU, **settings)
    assert words in str(fault.value)
