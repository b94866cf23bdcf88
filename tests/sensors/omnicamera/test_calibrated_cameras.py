"""Cameras of a calibration file in a robot file: names, poses on the IMU, and time shifts."""

import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml

from omnisim.core.errors import OmnisimError
from omnisim.core.files.image_files import read_image
from omnisim.core.poses import inverse, pose
from omnisim.core.trajectories import Trajectory
from omnisim.robots.vehicle import Vehicle
from omnisim.runs.drive import Drive
from omnisim.runs.route import Route
from omnisim.scene import load_scene

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"
SHIFT_S = 0.25


@pytest.fixture
def robot(tmp_path):
    """Writer of a robot with Kalibr's chain, whose second camera's stamps are early."""
    text = (EXAMPLES / "stereo.yaml").read_text()
    text += f"  timeshift_cam_imu: {SHIFT_S}\n"
    (tmp_path / "chain.yaml").write_text(text)
    shutil.copy(EXAMPLES / "camchain.yaml", tmp_path / "one.yaml")

    def write(*tables):
        path = tmp_path / "robot.toml"
        path.write_text('name = "cart"\n' + "".join(f"[[sensors]]\n{table}\n" for table in tables))
        return Vehicle.load(path)

    return write


def test_a_chain_is_on_the_mount_of_its_imu(robot, tmp_path):
    """T_cam_imu, by the file's own numbers."""
    vehicle = robot('file = "chain.yaml"\nposition_m = [0.1, 0.0, 0.5]\nyaw_deg = 90.0')
    chain = yaml.safe_load((tmp_path / "chain.yaml").read_text())
    base_from_imu = pose((0.1, 0.0, 0.5), yaw_deg=90.0)
    cam0_from_imu = np.array(chain["cam0"]["T_cam_imu"])
    cam1_from_imu = np.array(chain["cam1"]["T_cn_cnm1"]) @ cam0_from_imu
    assert [camera.name for camera in vehicle.cameras] == ["cam0", "cam1"]
    extrinsics = cam0_from_imu, cam1_from_imu
    for camera, camera_from_imu in zip(vehicle.cameras, extrinsics, strict=True):
        expected = base_from_imu @ inverse(camera_from_imu)
        np.testing.assert_allclose(camera.sensor.base_from_optical, expected, atol=1e-12)
    assert [camera.time_shift_s for camera in vehicle.cameras] == [0.0, SHIFT_S]
    fx, fy, *_ = chain["cam1"]["intrinsics"]
    assert vehicle.cameras[1].sensor.model.focal_lengths_px == (fx, fy)


def test_without_an_imu_the_first_camera_looks_along_the_mount(robot):
    (camera,) = robot('name = "front"\nfile = "one.yaml"\nposition_m = [0.0, 0.2, 1.0]').cameras
    assert camera.name == "front"
    optical = camera.sensor.base_from_optical
    np.testing.assert_allclose(optical[:3, 2], (1.0, 0.0, 0.0), atol=1e-12)
    np.testing.assert_allclose(optical[:3, 3], (0.0, 0.2, 1.0), atol=1e-12)


def test_one_camera_can_be_chosen_and_several_named(robot):
    one = robot('name = "right"\nfile = "chain.yaml"\ncamera = "cam1"')
    assert [camera.name for camera in one.cameras] == ["right"]
    several = robot('name = "rig"\nfile = "chain.yaml"', 'name = "back"\nfile = "chain.yaml"')
    names = ["rig_cam0", "rig_cam1", "back_cam0", "back_cam1"]
    assert [camera.name for camera in several.cameras] == names
    with pytest.raises(OmnisimError, match="sensor 'cam0': a second sensor of this name"):
        robot('file = "chain.yaml"', 'file = "chain.yaml"')
    with pytest.raises(OmnisimError, match=r"sensors\.0: .*expected one of cam0, cam1, got 'cam2'"):
        robot('file = "chain.yaml"\ncamera = "cam2"')
    with pytest.raises(OmnisimError, match=r"sensors\.0: file = 'none\.yaml': no such file"):
        robot('file = "none.yaml"')


@pytest.mark.usefixtures("needs_opengl")
def test_images_are_taken_at_the_shifted_time(robot, tmp_path):
    """The early camera's image at the first step is a camera's without shift 0.25 s later."""
    text, times_s = (tmp_path / "chain.yaml").read_text(), np.array([0.0, 1.0])
    pixels = []
    for shift_s, starts_m in ((SHIFT_S, 0.0), (0.0, 0.1)):  # 0.4 m/s
        (tmp_path / "chain.yaml").write_text(text.replace(str(SHIFT_S), str(shift_s)))
        vehicle = robot('file = "chain.yaml"\ncamera = "cam1"')
        vehicle = vehicle.with_cameras(size_px=32, quality="fast")
        drive = Drive(load_scene("rings"), vehicle, Route("line"), unlit=True)
        poses = np.stack([pose((x, 0.0, 0.5)) for x in (starts_m, starts_m + 0.4)])
        folder = tmp_path / f"{shift_s}"
        list(drive.along(Trajectory(times_s, poses)).record(folder))
        pixels.append(read_image(folder / "cam1" / "000000.png")[0])
    assert pixels[0].std() > 5
    np.testing.assert_array_equal(*pixels)
