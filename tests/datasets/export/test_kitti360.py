"""KITTI-360, read and projected as its development kit documents it."""

import json
import shutil

import numpy as np
import pytest
import yaml

from omnisim.cameras.calibration import load_calibration
from omnisim.core.errors import OmnisimError
from omnisim.core.files.image_files import read_image
from omnisim.core.trajectories import read_trajectory
from omnisim.datasets.export.export import export_run
from omnisim.datasets.export.export_format import ExportSettings
from omnisim.datasets.export.formats.kitti360 import _instances
from omnisim.datasets.export.recording import Recording
from omnisim.ground_truth.label_names import ClassLabel, InstanceLabel, Labels

pytestmark = pytest.mark.usefixtures("needs_opengl")
START_NS = 1_769_860_800_123_456_789
DRIVE = "2013_05_28_drive_0000_sync"
CAMERAS = {"image_00": "front", "image_02": "fisheye", "image_03": "mirror"}


@pytest.fixture(scope="module")
def kitti(run, tmp_path_factory):
    folder = tmp_path_factory.mktemp("kitti") / "out"
    list(export_run(run, "kitti360", folder, ExportSettings(START_NS)))
    return folder


def _poses(kitti):
    rows = np.loadtxt(kitti / "data_poses" / DRIVE / "poses.txt")
    np.testing.assert_array_equal(rows[:, 0], np.arange(len(rows)))
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    poses[:, :3] = rows[:, 1:].reshape(-1, 3, 4)
    return poses


def _extrinsics(kitti):
    found = {}
    for line in (kitti / "calibration" / "calib_cam_to_pose.txt").read_text().splitlines():
        name, _, numbers = line.partition(":")
        found[name] = np.vstack((np.fromstring(numbers, sep=" ").reshape(3, 4), (0, 0, 0, 1)))
    assert list(found) == ["image_00", "image_01", "image_02", "image_03"]
    return found


def _mei(path, points):
    """Projection of the development kit's CameraFisheye, with its tangential part."""
    text = path.read_text().replace("%YAML:1.0\n---\n", "")
    found = yaml.safe_load(text)
    assert found["model_type"] == "MEI"
    x, y, z = (points / np.linalg.norm(points, axis=1, keepdims=True)).T
    xi = found["mirror_parameters"]["xi"]
    x, y = x / (z + xi), y / (z + xi)
    k1, k2, p1, p2 = (found["distortion_parameters"][key] for key in ("k1", "k2", "p1", "p2"))
    r2 = x * x + y * y
    radial = 1 + k1 * r2 + k2 * r2 * r2
    u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    v = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    plane = found["projection_parameters"]
    return np.stack((plane["gamma1"] * u + plane["u0"], plane["gamma2"] * v + plane["v0"]), -1)


def _pinhole(path, points):
    numbers = dict(line.split(": ") for line in path.read_text().splitlines())
    projection = np.fromstring(numbers["P_rect_00"], sep=" ").reshape(3, 4)
    assert numbers["S_rect_00"] == "64 48"
    rays = points @ projection[:, :3].T
    return rays[:, :2] / rays[:, 2:]


@pytest.mark.parametrize("image", CAMERAS)
def test_points_project_to_their_pixels(kitti, seen, check_pixels, image):
    name = CAMERAS[image]
    data = "data_rect" if image == "image_00" else "data_rgb"
    within_px = {"front": 1e-3, "fisheye": 0.02, "mirror": 1e-3}[name]  # MEI's fit to the fisheye
    for step, world_from_imu in enumerate(_poses(kitti)):
        camera_from_world = np.linalg.inv(world_from_imu @ _extrinsics(kitti)[image])
        points = seen(name, step).world_m @ camera_from_world[:3, :3].T + camera_from_world[:3, 3]
        if image == "image_00":
            pixels = _pinhole(kitti / "calibration" / "perspective.txt", points)
        else:
            pixels = _mei(kitti / "calibration" / f"{image}.yaml", points)
        rgb = read_image(kitti / "data_2d_raw" / DRIVE / image / data / f"{step:010d}.png")[0]
        check_pixels(pixels, rgb, name, step, within_px)


def test_the_imu_looks_ahead_right_and_down(kitti, run):
    truth = read_trajectory(run / "ground_truth.tum").world_from_base
    poses = _poses(kitti)
    np.testing.assert_allclose(poses[:, :3, 3], truth[:, :3, 3], atol=1e-9)
    np.testing.assert_allclose(poses[:, :3, 0], truth[:, :3, 0], atol=1e-9)
    np.testing.assert_allclose(poses[:, :3, 1], -truth[:, :3, 1], atol=1e-9)
    assert load_calibration(kitti / "calibration").names == ["image_02", "image_03"]
    rows = np.loadtxt(kitti / "data_poses" / DRIVE / "cam0_to_world.txt")
    world_from_cam0 = poses @ _extrinsics(kitti)["image_00"]
    np.testing.assert_allclose(rows[:, 1:].reshape(-1, 4, 4), world_from_cam0, atol=1e-8)


def test_lidar_points_lie_in_the_world_where_the_lidar_saw_them(kitti, run):
    """The development kit's chain from the lidar over camera 0 and the IMU to the world."""
    cam0_to_velo = np.vstack(
        (np.loadtxt(kitti / "calibration" / "calib_cam_to_velo.txt").reshape(3, 4), (0, 0, 0, 1))
    )
    imu_from_velo = _extrinsics(kitti)["image_00"] @ np.linalg.inv(cam0_to_velo)
    data = kitti / "data_3d_raw" / DRIVE / "velodyne_points"
    recording = Recording.read(run)
    for step, world_from_imu in enumerate(_poses(kitti)):
        points = np.fromfile(data / "data" / f"{step:010d}.bin", dtype=np.float32).reshape(-1, 4)
        cloud = recording.cloud("lidar", step)
        expected = np.stack([cloud.points[axis] for axis in "xyz"], axis=-1)
        world_from_lidar = cloud.header.pose("world_from_lidar")
        np.testing.assert_array_equal(points[:, :3], expected)
        np.testing.assert_allclose(world_from_imu @ imu_from_velo, world_from_lidar, atol=1e-8)
    dates = (data / "timestamps.txt").read_text().splitlines()
    assert dates[1] == "2026-01-31 12:00:00.623456789"


def test_three_fisheyes_are_refused(run, tmp_path):
    """The fixture's run has two; its pinhole as a third."""
    shutil.copytree(run, tmp_path / "run")
    shutil.copy(run / "fisheye" / "calibration.json", tmp_path / "run" / "front")
    words = "at most two fisheyes, as KITTI-360 has, got front, fis"
    with pytest.raises(OmnisimError, match=words):
        list(export_run(tmp_path / "run", "kitti360", tmp_path / "out"))
    assert not (tmp_path / "out").exists()


def test_labels_are_those_of_the_run(kitti, run):
    """Numbers as kitti360scripts' global2local takes them apart."""
    folder = kitti / "data_2d_semantics" / "train" / DRIVE
    labels = json.loads((folder / "labels.json").read_text())
    names = {label["id"]: label["name"] for label in labels["instances"]}
    classes = {label["id"]: label["class"] for label in labels["instances"]}
    numbers = {}
    for camera, name in (("front", "image_00"), ("fisheye", "image_02"), ("mirror", "image_03")):
        recorded = Recording.read(run, camera).cameras[0]
        for step in range(4):
            semantic = read_image(folder / name / "semantic" / f"{step:010d}.png")[0][..., 0]
            instance = read_image(folder / name / "instance" / f"{step:010d}.png")[0][..., 0]
            assert (semantic.dtype, instance.dtype) == (np.uint8, np.uint16)
            own = {kind: recorded.channel(step, kind) for kind in ("semantic", "instance")}
            if camera == "mirror":
                own = {kind: values[:, ::-1] for kind, values in own.items()}
            np.testing.assert_array_equal(semantic, own["semantic"])
            np.testing.assert_array_equal(instance // 1000, own["semantic"])
            for number in np.unique(own["instance"]).tolist():
                (found,) = np.unique(instance[own["instance"] == number])
                assert numbers.setdefault(number, found) == found
    assert len(set(numbers.values())) == len(numbers) > 5
    for number, found in numbers.items():
        same = [one for one in names if number and classes[one] == classes[number]]
        assert found == (1000 * classes[number] + 1 + same.index(number) if number else 0)


def test_labels_that_do_not_fit_are_left_out():
    instances = [InstanceLabel(number, f"tree_{number}", 3) for number in range(1, 1001)]
    labels = Labels((ClassLabel(3, "tree", (0, 0, 0)),), tuple(instances), "names")
    numbers = _instances(labels)
    assert (numbers[1], numbers[999]) == (3001, 3999)
    assert numbers[1000] > 65535
