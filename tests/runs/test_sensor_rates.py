"""Sensors with rates of their own: stamps, files, runs that go on, and their exports."""

import dataclasses
import itertools
import json

import numpy as np
import pytest

from omnisim.core.errors import RunError
from omnisim.core.rate import SensorRate
from omnisim.core.trajectories import Trajectory, read_trajectory
from omnisim.datasets.export.export import export_run
from omnisim.datasets.export.recording import Recording
from omnisim.robots import parse_robot
from omnisim.robots.vehicle import Vehicle
from omnisim.runs import drive as drives
from omnisim.runs.drive import Drive
from omnisim.runs.route import Route
from omnisim.runs.run_data import read_run
from omnisim.runs.run_folder import RunFolder, read_times
from omnisim.scene import load_scene
from tests.conftest import open_context_or_skip
from tests.runs.test_drive import _bytes as bytes_of

KINEMATICS = {
    "type": "differential",
    "max_speed_mps": 1.0,
    "max_turn_rate_degps": 90.0,
    "max_acceleration_mps2": 0.5,
    "max_turn_acceleration_degps2": 90.0,
}
PLACE = {"position_m": [0.0, 0.0, 0.5]}
SONAR = {"name": "sonar", "type": "usarsim_sonar", **PLACE, "cones": 2, "rays_per_cone": 4}
IMU = {"name": "imu", "type": "imu", **PLACE}
CAMERA = {"name": "eye", "type": "depth_camera", **PLACE, "width_px": 16, "height_px": 12}
LIDAR = {"name": "lidar", "type": "lidar", **PLACE, "elevations_deg": [0.0], "firings": 60}


def vehicle_of(*sensors):
    return Vehicle.from_robot(
        parse_robot({"name": "a", "kinematics": KINEMATICS, "sensors": list(sensors)}, "robot")
    )


def drive_of(*sensors, **settings):
    scene = load_scene("soccer")
    path = dataclasses.replace(scene.paths[0], waypoints_m=((0.0, 0.0), (0.25, 0.0)))
    scene = dataclasses.replace(scene, paths=(path,))
    return Drive(scene, vehicle_of(*sensors), Route(path.name, step_m=0.07), seed=4, **settings)


def test_rates_phases_and_jitter():
    rate = SensorRate(20.0, 0.01, 0.0, "a")
    times = 3.01 + 0.05 * np.arange(20)
    np.testing.assert_allclose(rate.times_s(3.0, 4.0, 0, "a"), times, atol=1e-12)
    shaken = dataclasses.replace(rate, jitter_s=2e-3)
    times = shaken.times_s(0.0, 500.0, 0, "a")
    late = times - (0.01 + 0.05 * np.arange(len(times)))
    assert late.std() == pytest.approx(2e-3, rel=0.05)
    assert np.all(np.diff(times) > 0.0)
    # each stamp follows from seed, clock and number alone
    assert np.array_equal(shaken.times_s(0.0, 50.0, 0, "b"), times[:1000])
    assert not np.array_equal(shaken.times_s(0.0, 500.0, 1, "a"), times)
    other = dataclasses.replace(shaken, clock="b")
    assert not np.array_equal(other.times_s(0.0, 500.0, 0, "a"), times)


def test_sensors_of_a_trigger_fire_together():
    keys = {"rate_hz": 12.0, "phase_s": 0.01, "jitter_s": 1e-3, "trigger": "sync"}
    sonar, camera, lidar = vehicle_of(
        SONAR | keys, CAMERA | {"trigger": "sync"}, LIDAR | {"trigger": "sync"}
    ).sensors
    steps_s = np.array([0.0, 2.0])
    times = [one.times_s(steps_s, 4) for one in (sonar, camera, lidar)]
    assert np.array_equal(times[0], times[1])
    assert np.array_equal(times[0], times[2])
    assert lidar.sensor.rate_hz == 12.0
    assert vehicle_of(SONAR).sensors[0].times_s(steps_s, 0) is steps_s  # without a rate


def test_skipped_revolutions_and_what_is_too_near_at_the_start_are_mentioned():
    low = {"name": "low", "type": "omnicamera", "position_m": [0.0, 0.0, 0.03]}
    skipped, near = drive_of(LIDAR, low).plan().notes
    assert skipped.startswith("lidar: one cloud per step, of 5 of the lidar's 15")
    assert skipped.endswith("revolutions: rate_hz = 10 in its table records all")
    words = "low: clipped by the near plane, 0.05 m: line_halfway, carpet"
    assert near.startswith(words)
    assert not drive_of(LIDAR | {"rate_hz": 10.0}, low | PLACE).plan().notes


SENSORS = (
    SONAR | {"rate_hz": 5.0, "phase_s": 0.05, "jitter_s": 0.01},
    CAMERA,
    LIDAR | {"rate_hz": 10.0},
    IMU,
)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    open_context_or_skip().release()
    folder = tmp_path_factory.mktemp("rates") / "run"
    list(drive_of(*SENSORS).plan().record(folder))
    return folder


def test_each_sensor_has_its_own_files_and_stamps(whole):
    run, plan = RunFolder.read(whole), drive_of(*SENSORS).plan()
    end_s, steps = plan.motion.end_s, len(plan.truth)
    counts = {name: run.measurements(name) for name in ("sonar", "eye", "lidar", "imu")}
    assert counts == {
        "sonar": int((end_s - 0.05) * 5.0) + 1,
        "eye": steps,
        "lidar": int(end_s * 10.0) + 1,
        "imu": int(end_s * 200.0) + 1,
    }
    for name, suffix in (("sonar", ".csv"), ("lidar", ".ply"), ("eye", ".png")):
        files = [run.file(name, index, suffix).name for index in range(counts[name])]
        assert sorted(path.name for path in (whole / name).glob(f"0*{suffix}")) == files
        np.testing.assert_array_equal(run.times_s(name), plan.sensor_times_s[name].round(9))
        parts = [run.indices_at(name, step) for step in range(steps)]
        assert list(itertools.chain(*parts)) == list(range(counts[name]))
        for step, part in enumerate(parts):
            stamps = run.times_s(name)[list(part)]
            assert np.all(stamps <= plan.truth.times_s[step] + 1e-9)
            assert step == 0 or np.all(stamps > plan.truth.times_s[step - 1])
    assert not (whole / "eye" / "times.csv").exists()


def test_true_states_are_at_all_stamps(whole):
    recording, motion = Recording.read(whole), drive_of(*SENSORS).plan().motion
    stamps = [recording.run.times_s(name) for name in ("sonar", "eye", "lidar", "imu")]
    assert np.all(np.isin(np.concatenate(stamps).round(9), recording.state_times_s))
    assert recording.state_times_s[0] == 0.0
    # and within each revolution, close enough for straight lines between them
    assert np.diff(recording.state_times_s).max() < 1.0 / 160.0 + 1e-9
    truth = recording.fine_truth
    for time_s in np.linspace(0.0, motion.end_s, 200):
        np.testing.assert_allclose(truth.pose_at(time_s), motion.pose_at(time_s), atol=1e-5)
    for times_s in stamps:
        states, truth = recording.states(times_s), motion.at(times_s)
        for name, atol in (("world_from_base", 2e-9), ("velocity_mps", 1e-8)):
            np.testing.assert_allclose(getattr(states, name), getattr(truth, name), atol=atol)


def test_a_measurement_is_of_its_own_time(whole):
    recording, motion = Recording.read(whole), drive_of(*SENSORS).plan().motion
    for index, time_s in enumerate(recording.times_s("lidar")):
        found = recording.cloud("lidar", index).header.pose("world_from_lidar")[:3, 3]
        expected = motion.pose_at(time_s)[:3, 3] + (0.0, 0.0, 0.5)
        np.testing.assert_allclose(found, expected, atol=1e-6)


def test_a_run_that_was_stopped_ends_with_the_same_bytes(whole, tmp_path):
    run, drive = tmp_path / "run", drive_of(*SENSORS)
    recording = drive.plan().record(run)
    for _ in range(3):
        next(recording)
    recording.close()
    (run / "lidar" / "times.csv").unlink()
    (run / "lidar" / "000003.ply").write_bytes(b"")
    (run / "states.csv").unlink()
    steps = list(drive.plan().record(run))
    assert steps[0] < steps[-1]
    assert bytes_of(run) == bytes_of(whole)


def test_measurements_beyond_those_in_progress_are_written_at_once(whole, tmp_path, monkeypatch):
    """Their order, and thus their number in memory, is that of the measurements."""
    events, moment = [], drives.PlannedDrive._moment

    def begun(plan, *arguments):
        events.append("begun")
        return moment(plan, *arguments)

    def submitted(writer, *arguments):
        events.append("written")
        return write(writer, *arguments)

    write = drives._write
    monkeypatch.setattr(drives, "MAX_BEGUN", 1)
    monkeypatch.setattr(drives, "_write", submitted)
    monkeypatch.setattr(drives.PlannedDrive, "_moment", begun)
    list(drive_of(*SENSORS).plan().record(tmp_path / "run"))
    assert bytes_of(tmp_path / "run") == bytes_of(whole)
    in_progress = np.cumsum([1 if event == "begun" else -1 for event in events])
    assert (in_progress.max(), in_progress[-1]) == (2, 0)


def test_damaged_times_are_named(tmp_path):
    (tmp_path / "times.csv").write_text("t_s\n0.1\n0.1\n")
    with pytest.raises(RunError, match=r"times\.csv: expected t_s and 2 times that increase"):
        read_times(tmp_path / "times.csv", 2)


def test_frames_are_the_slowest_sensors(whole):
    notes = []
    recording = Recording.read(whole).in_frames(["lidar", "sonar"], notes.append)
    sonar_s = recording.run.times_s("sonar")
    np.testing.assert_array_equal(recording.truth.times_s, sonar_s)
    lidar_s = recording.times_s("lidar")
    assert np.abs(lidar_s - sonar_s).max() <= 0.05 + 1e-9
    (note,) = notes
    assert note.startswith("lidar: measures up to 0.0")
    assert note.endswith(" s from sonar, whose times are used")
    pose = recording.cloud("lidar", 3).header.pose("world_from_lidar")
    at = recording.states(lidar_s[3:4]).world_from_base[0, :3, 3]
    np.testing.assert_allclose(pose[:3, 3], at + (0.0, 0.0, 0.5), atol=1e-6)


@pytest.mark.usefixtures("needs_opengl")
@pytest.mark.slow
def test_exports_have_each_sensors_own_stamps(tmp_path):
    rosbags = pytest.importorskip("rosbags.highlevel")
    camera = {"name": "cam", "type": "omnicamera", "rate_hz": 4.0, **PLACE}
    vehicle = vehicle_of(camera, LIDAR | {"rate_hz": 10.0}, SONAR, IMU)
    drive = drive_of(channels=("instance",))
    drive = dataclasses.replace(drive, vehicle=vehicle.with_cameras(size_px=32, quality="fast"))
    run = tmp_path / "run"
    list(drive.plan().record(run))
    folder = RunFolder.read(run)
    images = folder.measurements("cam")
    coco = json.loads((run / "cam" / "coco.json").read_text())
    assert len(coco["images"]) == images
    list(export_run(run, "ros2-mcap", tmp_path / "bag"))
    with rosbags.AnyReader([tmp_path / "bag"]) as reader:
        counts = {connection.topic: connection.msgcount for connection in reader.connections}
    truth = len(Recording.read(run).state_times_s)
    expected = {
        "/cam/image_raw": images,
        "/lidar/points": folder.measurements("lidar"),
        "/imu/data_raw": folder.measurements("imu"),
        "/sonar/range": folder.manifest.steps,
        "/odom": folder.manifest.steps,
        "/ground_truth/pose": truth,
        "/ground_truth/odom": truth,
    }
    assert {topic: counts[topic] for topic in expected} == expected
    with pytest.raises(RunError, match="camera 'cam' has a rate of its own"):
        read_run(run)


@pytest.mark.usefixtures("needs_opengl")
def test_poses_of_a_rigs_camera_are_at_its_own_stamps(tmp_path):
    camera = {"name": "cam", "type": "omnicamera", "rate_hz": 4.0, **PLACE}
    vehicle = vehicle_of(camera).with_cameras(size_px=16, quality="fast")
    drive = dataclasses.replace(drive_of(), vehicle=vehicle)
    times = np.array([0.0, 1.0])
    poses = Trajectory.on_ground(times, np.column_stack((times, 0.0 * times)), 0.0 * times)
    list(drive.along(poses).record(tmp_path / "run"))
    found = read_trajectory(tmp_path / "run" / "cam" / "poses.tum")
    np.testing.assert_allclose(found.times_s, 0.25 * np.arange(5))
    np.testing.assert_allclose(found.positions_m[:, 0], 0.25 * np.arange(5), atol=1e-8)
