"""KITTI's odometry layout: projected by the benchmark's formulas, and KISS-ICP's command."""

import json
import os
import shutil
import subprocess
import sys

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from omnisim.core.errors import OmnisimError
from omnisim.core.files.image_files import read_image
from omnisim.core.trajectories import read_trajectory
from omnisim.datasets.export.export import export_run
from omnisim.datasets.export.recording import Recording
from omnisim.robots import parse_robot
from omnisim.robots.vehicle import Vehicle
from omnisim.runs.drive import Drive
from omnisim.runs.route import Route
from omnisim.scene import load_scene

pytestmark = pytest.mark.usefixtures("needs_opengl")


@pytest.fixture(scope="module")
def kitti(run, tmp_path_factory):
    folder = tmp_path_factory.mktemp("kitti") / "out"
    notes = []
    list(export_run(run, "kitti", folder, print_note=notes.append))
    assert "front is image_2" in notes
    assert "kitti holds two pinholes: fisheye, mirror left out" in notes
    return folder


def _calibration(kitti):
    lines = (kitti / "sequences" / "00" / "calib.txt").read_text().splitlines()
    found = {}
    for line in lines:
        name, _, numbers = line.partition(": ")
        found[name] = np.array(numbers.split(), dtype=float).reshape(3, 4)
    assert list(found) == ["P0", "P1", "P2", "P3", "Tr"]
    return found


def _poses(kitti):
    rows = np.loadtxt(kitti / "poses" / "00.txt").reshape(-1, 3, 4)
    last = np.tile([[[0.0, 0.0, 0.0, 1.0]]], (len(rows), 1, 1))
    return np.concatenate((rows, last), axis=1)


def _camera_0(run):
    """True poses of camera 0."""
    mount = Recording.read(run, "front").cameras[0].mount.base_from_optical
    return read_trajectory(run / "ground_truth.tum").world_from_base @ mount


def test_poses_are_camera_0s_in_its_first_frame(kitti, run):
    poses, true = _poses(kitti), _camera_0(run)
    np.testing.assert_array_equal(poses[0], np.eye(4))
    np.testing.assert_allclose(true[0] @ poses, true, atol=1e-9)
    times_s = np.loadtxt(kitti / "sequences" / "00" / "times.txt")
    np.testing.assert_allclose(times_s, [0.0, 0.5, 1.0, 1.5])


def test_points_project_to_their_pixels(kitti, run, seen, check_pixels):
    """x = P2 (camera 0 from world) X."""
    projection, first = _calibration(kitti)["P2"], _camera_0(run)[0]
    for step, pose in enumerate(_poses(kitti)):
        world_m = seen("front", step).world_m
        points = np.column_stack((world_m, np.ones(len(world_m)))) @ np.linalg.inv(first @ pose).T
        pixels = points @ projection.T
        image = read_image(kitti / "sequences" / "00" / "image_2" / f"{step:06d}.png")[0]
        check_pixels(pixels[:, :2] / pixels[:, 2:], image, "front", step)


def test_clouds_are_without_skew(kitti, run):
    """Each point, seen from where the lidar was at its time, is where KITTI's chain has it."""
    recording, first = Recording.read(run), _camera_0(run)[0]
    base_from_lidar = recording.base_from_lidar("lidar")
    camera_from_lidar = np.vstack((_calibration(kitti)["Tr"], (0, 0, 0, 1)))
    moved, truth = 0.0, recording.fine_truth
    for step, pose in enumerate(_poses(kitti)):
        file = kitti / "sequences" / "00" / "velodyne" / f"{step:06d}.bin"
        points = np.fromfile(file, dtype=np.float32).reshape(-1, 4)
        assert 0.0 < points[:, 3].max() <= 1.0
        chain = first @ pose @ camera_from_lidar
        cloud = recording.cloud("lidar", step).points
        start_s = recording.truth.times_s[step] - 0.1
        for own, point in list(zip(cloud, points, strict=True))[::7]:
            lidar = truth.pose_at(start_s + float(own["time"])) @ base_from_lidar
            expected = lidar[:3, :3] @ [own["x"], own["y"], own["z"]] + lidar[:3, 3]
            got = chain[:3, :3] @ point[:3].astype(float) + chain[:3, 3]
            np.testing.assert_allclose(got, expected, atol=2e-6)
            moved = max(moved, np.abs(point[:3] - [own["x"], own["y"], own["z"]]).max())
    assert moved > 0.03  # the robot drives 4 cm in a revolution


def test_without_a_pinhole_camera_0_stands_in_the_lidars_place(run, tmp_path):
    shutil.copytree(run, tmp_path / "run")
    manifest = json.loads((tmp_path / "run" / "manifest.json").read_text())
    del manifest["sensors"]["front"]
    (tmp_path / "run" / "manifest.json").write_text(json.dumps(manifest))
    notes = []
    list(export_run(tmp_path / "run", "kitti", tmp_path / "out", print_note=notes.append))
    assert sum("camera 0 is at the position of lidar" in note for note in notes) == 1
    calibration = _calibration(tmp_path / "out")
    ahead = calibration["Tr"] @ (5.0, 0.5, 0.2, 1.0)  # x forward, y left, z up
    np.testing.assert_allclose(ahead, (-0.5, -0.2, 5.0), atol=1e-12)
    np.testing.assert_array_equal(calibration["P0"], np.eye(3, 4))


def test_pinholes_that_are_not_parallel_are_refused(run, tmp_path):
    """The fixture's fisheye with the pinhole's lens: it is turned by 20°."""
    shutil.copytree(run, tmp_path / "run")
    front = json.loads((run / "front" / "calibration.json").read_text())
    fisheye = json.loads((run / "fisheye" / "calibration.json").read_text())
    fisheye["camera"] = front["camera"]
    (tmp_path / "run" / "fisheye" / "calibration.json").write_text(json.dumps(fisheye))
    with pytest.raises(OmnisimError, match=r"expected parallel pinholes, .* got front, fisheye"):
        list(export_run(tmp_path / "run", "kitti", tmp_path / "out"))
    assert not (tmp_path / "out").exists()


def test_cameras_without_a_place_do_not_set_the_pace(fast_run, tmp_path):
    """All six clouds of a lidar of 10 Hz, and not the two images' of a fisheye of 2 Hz."""
    notes = []
    list(export_run(fast_run, "kitti", tmp_path / "out", print_note=notes.append))
    clouds = sorted((tmp_path / "out" / "sequences" / "00" / "velodyne").iterdir())
    assert [cloud.stem for cloud in clouds] == [f"{number:06d}" for number in range(6)]
    assert "kitti holds two pinholes: fisheye left out" in notes


KISS_ICP = "from kiss_icp.tools.cmd import run; run()"  # its command kiss_icp_pipeline
CART = {
    "name": "cart",
    "kinematics": {"type": "differential", "max_speed_mps": 1.0, "max_turn_rate_degps": 30.0,
                   "max_acceleration_mps2": 0.5, "max_turn_acceleration_degps2": 30.0},
}  # fmt: skip
# A lidar's height and waypoints. A flat floor's rings move with the lidar and hold KISS-ICP back:
# the courtyard's, which is wide, are fewer from higher up.
WAYS = {
    "courtyard": (1.4, "-3,-2.5\n3,-2.5\n4.5,0\n"),
    "soccer": (0.9, "2.3,1.5\n-2.3,1.5\n-2.3,-1.5\n"),
    "mapping": (0.9, "1,2\n7,2\n7,-3\n"),
}


def _estimated(data, folder, *words):
    """Positions (n, 3) of the lidar by KISS-ICP's own command, in its frame at the first cloud."""
    settings = {"kiss_icp_out_dir": str(folder), "kiss_icp_mapping": '{"voxel_size": 0.5}'}
    command = [sys.executable, "-c", KISS_ICP, str(data), *words]
    # its table of times fails with NumPy 2.5, after the poses are written
    done = subprocess.run(command, env=os.environ | settings, check=False, capture_output=True)
    files = list((folder / "latest").glob("*_poses.npy"))
    assert files, done.stderr.decode()
    return np.load(files[0])[:, :3, 3]


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.parametrize("scene", WAYS)
def test_kiss_icp_finds_the_lidars_way(scene, tmp_path):
    """By KITTI's layout and by the bag with each point's time; every revolution has a cloud."""
    pytest.importorskip("kiss_icp", reason="kiss-icp is not installed")
    pytest.importorskip("rosbags", reason="the extra ros is not installed")
    height_m, waypoints_m = WAYS[scene]
    lidar = {"name": "lidar", "type": "lidar", "rate_hz": 10.0, "position_m": [0, 0, height_m]}
    (tmp_path / "way.csv").write_text(f"x_m,y_m\n{waypoints_m}")
    vehicle = Vehicle.from_robot(parse_robot(CART | {"sensors": [lidar]}, "cart"))
    route = Route(str(tmp_path / "way.csv"), step_m=1.0, step_deg=45.0)
    list(Drive(load_scene(scene), vehicle, route).plan().record(tmp_path / "run"))
    recording = Recording.read(tmp_path / "run")
    base = recording.states(recording.times_s("lidar")).world_from_base
    poses = base @ recording.base_from_lidar("lidar")
    true_m = (np.linalg.inv(poses[0]) @ poses)[:, :3, 3]
    kitti, bag = tmp_path / "kitti", tmp_path / "bag"
    list(export_run(tmp_path / "run", "kitti", kitti))
    list(export_run(tmp_path / "run", "ros2-mcap", bag))
    found = {
        "kitti": _estimated(kitti, tmp_path / "k", "--dataloader", "kitti", "--sequence", "0"),
        "bag": _estimated(bag, tmp_path / "b"),
    }
    for positions_m in found.values():
        turn, _ = Rotation.align_vectors(
            true_m - true_m.mean(axis=0), positions_m - positions_m.mean(axis=0)
        )
        aligned_m = turn.apply(positions_m - positions_m.mean(axis=0)) + true_m.mean(axis=0)
        ate_m = np.sqrt(np.mean(np.sum((aligned_m - true_m) ** 2, axis=1)))
        print(f"{scene}: ATE {ate_m:.4f} m over {len(true_m)} clouds")
        assert ate_m < 0.05
