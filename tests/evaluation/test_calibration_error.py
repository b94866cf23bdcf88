"""Wrong calibrations: what estimators are given; the drive's own files stay as they are."""

import shutil

import numpy as np
import pytest

from omnisim.core.errors import EstimatorError, PlanError
from omnisim.core.files.parameters import parse_table
from omnisim.core.poses import inverse, pose
from omnisim.datasets.export.recording import Recording, read_cloud
from omnisim.evaluation.calibration_error import CalibrationComparison, write_given_run
from omnisim.evaluation.run_evaluation import evaluate_estimator
from omnisim.sensors.lidar.point_files import write_points
from tests.evaluation.in_process import run_in_process
from tests.evaluation.test_estimators import IMU, LIDAR, record

LENS = """
[lens]
model = "equidistant"
width_px = 24
height_px = 24
focal_length_px = 10.0
principal_point_px = [11.5, 11.5]
theta_max_deg = 60.0
"""
CAMERA = """
[[sensors]]
name = "front"
type = "omnicamera"
file = "lens.toml"
rate_hz = 2.0
position_m = [0.1, 0.0, 0.5]
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rig")
    (folder / "lens.toml").write_text(LENS)
    lidar = LIDAR.replace("10.0", "2.0", 1) + "firings = 36\nelevations_deg = [0.0, 5.0]\n"
    options = ("--backend", "rays", "--unlit")
    waypoints = "x_m,y_m\n-1,0\n0,0.6\n"
    return record(folder, IMU + lidar + CAMERA, "way.csv", waypoints=waypoints, options=options)


def given(run, folder, **errors):
    """Recording with errors by sensor."""
    tables = {
        name: parse_table(error, CalibrationComparison, PlanError) for name, error in errors.items()
    }
    write_given_run(Recording.read(run), tables, folder / "given")
    return Recording.read(folder / "given")


def test_extrinsics_are_wrong_by_the_error(run, tmp_path):
    error = {"offset_m": (0.01, 0.0, -0.02), "yaw_deg": 2.0}
    wrong, true = given(run, tmp_path, front=error, imu=error, lidar=error), Recording.read(run)
    turn = pose((0.0, 0.0, 0.0), yaw_deg=2.0)
    for recording_of in (
        lambda one: one.cameras[0].mount.base_from_optical,
        lambda one: one.base_from_imu("imu"),
        lambda one: one.base_from_lidar("lidar"),
    ):
        before, after = recording_of(true), recording_of(wrong)
        np.testing.assert_allclose(after[:3, 3] - before[:3, 3], (0.01, 0.0, -0.02), atol=1e-9)
        np.testing.assert_allclose((inverse(before) @ after)[:3, :3], turn[:3, :3], atol=1e-9)


@pytest.mark.parametrize("file_format", ["ply", "pcd"])
def test_all_clouds_have_the_wrong_mount(run, tmp_path, file_format):
    """Each cloud's poses are those of the miscalibrated lidar; its points are as recorded."""
    true = Recording.read(run)
    if file_format == "pcd":
        true = _with_pcd(run, tmp_path / "pcd")
    error = CalibrationComparison(offset_m=(0.01, 0.0, -0.02), yaw_deg=2.0)
    write_given_run(true, {"lidar": error}, tmp_path / "given")
    wrong = Recording.read(tmp_path / "given")
    true_from_wrong = inverse(true.base_from_lidar("lidar")) @ wrong.base_from_lidar("lidar")
    assert len(true.times_s("lidar")) > 3
    for index in range(len(true.times_s("lidar"))):
        before, after = (one.cloud("lidar", index) for one in (true, wrong))
        for key in ("world_from_lidar_at_start", "world_from_lidar"):
            expected = before.header.pose(key) @ true_from_wrong
            np.testing.assert_allclose(after.header.pose(key), expected, atol=1e-6)
        assert np.array_equal(after.points, before.points)
        changed = {key for key, value in before.header.values.items()
                   if after.header.values[key] != value}  # fmt: skip
        assert changed == {"world_from_lidar_at_start", "world_from_lidar"}


def _with_pcd(run, folder):
    """Copy of the run whose clouds are PCD files."""
    shutil.copytree(run, folder)
    for path in (folder / "lidar").glob("*.ply"):
        cloud = read_cloud(path)
        pose = cloud.header.pose("world_from_lidar")
        write_points(path.with_suffix(".pcd"), cloud.points, pose, cloud.header.values)
        path.unlink()
    manifest = (folder / "manifest.json").read_text()
    (folder / "manifest.json").write_text(manifest.replace('"ply"', '"pcd"'))
    return Recording.read(folder)


def test_a_stride_takes_every_third_image(run):
    """For estimators that need only part of a long run."""
    whole = Recording.read(run).in_frames(["front"], lambda note: None)
    part = whole.every(3)
    assert part.steps == -(-whole.steps // 3)
    assert np.array_equal(part.truth.times_s, whole.truth.times_s[::3])
    assert np.array_equal(part.times_s("front")[2], whole.times_s("front")[6])
    assert np.array_equal(part.cameras[0].image(2), whole.cameras[0].image(6))
    assert not np.array_equal(part.cameras[0].image(2), whole.cameras[0].image(2))


def test_focal_lengths_are_scaled(run, tmp_path):
    wrong = given(run, tmp_path, front={"focal_scale": 1.02}).cameras[0].mount.camera
    assert wrong.parameters()["focal_length_px"] == pytest.approx(10.2)
    camera = Recording.read(run).cameras[0].mount.camera  # the drive's own is as it was
    assert camera.parameters()["focal_length_px"] == 10.0


def test_stamps_are_late_and_all_else_is_linked(run, tmp_path):
    late = {"time_offset_s": 0.025}
    wrong, true = given(run, tmp_path, front=late, imu=late, lidar=late), Recording.read(run)
    for name in ("front", "lidar"):
        np.testing.assert_allclose(wrong.times_s(name) - true.times_s(name), 0.025, atol=1e-12)
    readings = wrong.imu_readings("imu"), true.imu_readings("imu")
    np.testing.assert_allclose(readings[0].times_s - readings[1].times_s, 0.025, atol=1e-12)
    assert np.array_equal(readings[0].values, readings[1].values)
    late_s = wrong.times_s("lidar")
    for index in range(len(late_s)):
        header = wrong.cloud("lidar", index).header
        assert header.number("time_s") == pytest.approx(late_s[index])
    # the lidar's mount does not follow from the wrong stamp
    mounts = wrong.base_from_lidar("lidar"), true.base_from_lidar("lidar")
    np.testing.assert_allclose(*mounts, atol=1e-9)
    assert (tmp_path / "given" / "front" / "000001.png").is_symlink()


@pytest.mark.parametrize("offset_s", [-0.05, 0.05])
def test_wrong_stamps_are_an_error_of_the_speed_times_the_offset(
    run, tmp_path, offset_s, monkeypatch
):
    """The IMU's integral starts at rest, though the robot moves at a late first stamp."""
    run_in_process(monkeypatch)
    given(run, tmp_path, imu={"time_offset_s": offset_s})
    outcome = evaluate_estimator(run, "imu", tmp_path / "out", 60.0, given=tmp_path / "given")
    recording = Recording.read(run)
    times_s = recording.imu_readings("imu").times_s
    speeds = np.linalg.norm(recording.states(times_s).velocity_mps, axis=1)
    expected_m = abs(offset_s) * np.sqrt(np.mean(np.square(speeds)))
    assert outcome.errors.ate_m == pytest.approx(expected_m, rel=0.03)  # of speeds that change


@pytest.mark.parametrize("name", ["imu", "lidar"])
def test_errors_that_a_sensor_cannot_have_are_refused(run, tmp_path, name):
    with pytest.raises(EstimatorError, match=f"{name}: focal_scale: expected a camera"):
        given(run, tmp_path, **{name: {"focal_scale": 1.1}})
