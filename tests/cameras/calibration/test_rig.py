"""Rigs: poses of cameras on a body, chained from calibration files."""

import shutil

import numpy as np
import pytest

from omnisim.cameras import PerspectiveCamera
from omnisim.cameras.calibration import CalibratedCamera, Calibration, NamedPose, load_calibration
from omnisim.cameras.calibration.calibration import Rig
from omnisim.core.errors import CalibrationError
from omnisim.core.poses import pose, rotation_from_quaternion
from tests.cameras.calibration.sample_files import FOLDER

LENS = PerspectiveCamera(64, 48, 40.0, (31.5, 23.5))


def _calibration(**poses_by_camera):
    cameras = [CalibratedCamera(name, LENS, tuple(one)) for name, one in poses_by_camera.items()]
    return Calibration(tuple(cameras), source="rig.yaml")


def test_kalibrs_chain_hangs_from_the_imu():
    calibration = load_calibration(FOLDER / "kalibr_tum_vi.yaml")
    rig = Rig.of(calibration)
    first, second = (camera.body_from_camera for camera in rig.cameras)
    # published: T_cam_imu takes the IMU to cam0, T_cn_cnm1 takes cam0 to cam1
    (cam0_from_imu,) = (one.target_from_source for one in calibration.cameras[0].poses)
    np.testing.assert_allclose(first @ cam0_from_imu, np.eye(4), atol=1e-9)
    baseline_m = np.linalg.norm(first[:3, 3] - second[:3, 3])
    assert baseline_m == pytest.approx(0.10108, abs=1e-5)  # the data set's stereo baseline
    assert (rig.only("cam1").body, rig.only("cam1").cameras) == ("imu", rig.cameras[1:])
    with pytest.raises(CalibrationError, match=r"camera 'cam2': expected one of cam0, cam1"):
        rig.only("cam2")


def test_basalts_poses_are_those_of_its_cameras_on_the_imu():
    rig = Rig.of(load_calibration(FOLDER / "basalt_tum_vi_ds.json"))
    (camera,) = rig.cameras
    assert rig.body == "imu"
    quaternion = np.array([[0.0132723165788, 0.694725617491, -0.719111722761, 0.00764801952284]])
    rotation = rotation_from_quaternion(quaternion)[0]
    np.testing.assert_allclose(camera.body_from_camera[:3, :3], rotation, atol=1e-12)
    np.testing.assert_allclose(
        camera.body_from_camera[:3, 3], [0.0453656607259, -0.0719960019392, -0.0447818071239]
    )


def test_a_rig_without_another_frame_hangs_from_its_first_camera():
    right_from_left = pose((-0.1, 0.0, 0.0), yaw_deg=3.0)
    rig = Rig.of(_calibration(left=(), right=[NamedPose("right", "left", right_from_left)]))
    left, right = (camera.body_from_camera for camera in rig.cameras)
    assert (rig.body, rig.has_body) == ("left", False)
    np.testing.assert_array_equal(left, np.eye(4))
    np.testing.assert_allclose(right @ right_from_left, np.eye(4), atol=1e-15)


def test_poses_in_the_world_are_no_mounting():
    poses = [
        NamedPose("world", "base", pose((5.0, 0.0, 0.0))),
        NamedPose("base", "cam0", pose((0.0, 0.0, 1.0))),
    ]
    rig = Rig.of(_calibration(cam0=poses))
    assert rig.body == "base"
    np.testing.assert_array_equal(rig.cameras[0].body_from_camera[:3, 3], (0.0, 0.0, 1.0))


def test_a_camera_without_extrinsics_is_refused_unless_it_is_taken_alone():
    with pytest.raises(CalibrationError, match=r"cam1: expected its pose from cam0, got no extri"):
        Rig.of(_calibration(cam0=(), cam1=()))
    calibration = _calibration(cam0=(), cam1=(), cam2=[NamedPose("cam2", "cam0", pose())])
    assert Rig.of(calibration, "cam1").body == "cam1"
    assert [camera.name for camera in Rig.of(calibration, "cam2").cameras] == ["cam0", "cam2"]
    with pytest.raises(CalibrationError, match=r"expected one of cam0, cam1, cam2, got 'cam7'"):
        Rig.of(calibration, "cam7")


def test_extrinsics_that_contradict_each_other_are_refused():
    first = NamedPose("cam0", "imu", pose())
    second = NamedPose("cam1", "cam0", pose((0.1, 0.0, 0.0)))
    agreeing, other = (NamedPose("cam1", "imu", pose((0.1, y, 0.0))) for y in (0.0, 0.012))
    assert Rig.of(_calibration(cam0=[first], cam1=[second, agreeing])).body == "imu"
    with pytest.raises(CalibrationError, match=r"cam1 from imu: expected .* got one 12 mm and 0°"):
        Rig.of(_calibration(cam0=[first], cam1=[second, other]))


@pytest.fixture
def kitti360(tmp_path):
    """KITTI-360's folder: its fisheyes, which look left and right, on axes of our own."""
    for name in ("image_02", "image_03"):
        shutil.copy(FOLDER / f"kitti360_{name}.yaml", tmp_path / f"{name}.yaml")
    (tmp_path / "calib_cam_to_pose.txt").write_text(
        "image_00: 0 0 1 1.5 1 0 0 0 0 1 0 -0.6\n"
        "image_02: 1 0 0 0.7 0 0 -1 -0.3 0 1 0 -0.9\n"
        "image_03: -1 0 0 0.7 0 0 1 0.9 0 1 0 -0.9\n"
    )
    return tmp_path


def test_kitti360s_fisheyes_hang_from_its_imu(kitti360):
    rig = Rig.of(load_calibration(kitti360))
    assert [camera.name for camera in rig.cameras] == ["image_02", "image_03"]
    assert rig.body == "imu"
    # x of the IMU is ahead, y right, z down: the left fisheye looks along −y
    np.testing.assert_array_equal(rig.cameras[0].body_from_camera[:3, 2], (0.0, -1.0, 0.0))
    np.testing.assert_array_equal(rig.cameras[1].body_from_camera[:3, 3], (0.7, 0.9, -0.9))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("image_02: 1 2 3", "calib_cam_to_pose.txt:1: expected 12 numbers"),
        ("image_02: 2 0 0 0 0 1 0 0 0 0 1 0", ":1: expected a rotation and a translation"),
        ("image_02 1 0 0", ":1: expected image_00: and 12 numbers"),
        ("image_02: 1 0 0 a 0 1 0 0 0 0 1 0", ":1: expected a number, got 'a'"),
        ("image_00: 1 0 0 0 0 1 0 0 0 0 1 0", "expected image_02.yaml or image_03.yaml"),
    ],
)
def test_a_broken_folder_of_kitti360_is_named(kitti360, text, words):
    (kitti360 / "calib_cam_to_pose.txt").write_text(text)
    with pytest.raises(CalibrationError, match=words):
        load_calibration(kitti360)
