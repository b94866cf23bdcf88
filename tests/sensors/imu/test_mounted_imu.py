"""The IMU: closed forms, strapdown integration, Allan deviations, and runs that go on."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from omnisim.core.errors import RobotFileError, RunError
from omnisim.core.package_files import SCENES
from omnisim.core.poses import pose
from omnisim.core.trajectories import Trajectory
from omnisim.core.trajectories.body_motion import SplineMotion
from omnisim.robots import load_robot, parse_robot
from omnisim.robots.vehicle import Vehicle
from omnisim.runs.drive import Drive
from omnisim.runs.route import Route
from omnisim.scene import load_scene
from omnisim.sensors.imu.imu import COLUMNS, DEVICES, ImuErrors, true_readings

G = 9.80665
IMU = {"name": "imu", "type": "imu", "position_m": [0.0, 0.0, 0.0]}
ROUTE = Route("lap", step_m=1.2, step_deg=45.0)


def vehicle_of(**keys):
    return Vehicle.from_robot(parse_robot({"name": "a", "sensors": [IMU | keys]}, "robot"))


def readings_of(trajectory, seed=0, **keys):
    """Readings (n, 7) of a drive along a trajectory, with their times."""
    (sensor,) = vehicle_of(**keys).sensors
    times = sensor.times_s(trajectory.times_s, seed)
    return np.column_stack(
        (times, sensor.sensor.readings(sensor, SplineMotion(trajectory), seed, times))
    )


def wavy():
    """A motion about all axes, in 41 poses."""
    times = np.linspace(0.0, 4.0, 41)
    turns = np.column_stack((0.8 * np.sin(times), 0.4 * np.cos(1.3 * times), 0.3 * times))
    poses = np.tile(np.eye(4), (41, 1, 1))
    poses[:, :3, :3] = Rotation.from_euler("ZYX", turns).as_matrix()
    poses[:, :3, 3] = np.column_stack((times, np.sin(times), 0.2 * np.cos(2.0 * times)))
    return Trajectory(times, poses)


def test_at_rest_it_feels_gravity_along_its_own_axes():
    trajectory = Trajectory(np.array([5.0, 6.0]), np.stack([pose((1, 2, 3), yaw_deg=70.0)] * 2))
    rows = readings_of(trajectory, device="ideal", roll_deg=90.0, rate_hz=10.0)
    np.testing.assert_allclose(rows[:, 0], np.linspace(5.0, 6.0, 11), atol=1e-12)
    # y of the unit points up
    np.testing.assert_allclose(rows[:, 1:], np.tile((0, 0, 0, 0, G, 0), (11, 1)), atol=1e-12)
    one = readings_of(Trajectory(np.zeros(1), np.eye(4)[None]), device="ideal")
    np.testing.assert_allclose(one, [(0, 0, 0, 0, 0, 0, G)], atol=1e-12)


def test_a_lever_arm_adds_the_centripetal_acceleration_of_a_turn_on_the_spot():
    rate, times = 2.0, np.linspace(0.0, 3.0, 31)
    trajectory = Trajectory.on_ground(times, np.zeros((31, 2)), rate * times)
    rows = readings_of(trajectory, device="ideal", position_m=[0.5, 0.0, 0.2])
    # the mean over a reading's turn; at both ends over half of it
    mean = np.sinc(rate / 200.0 / (2.0 * math.pi))
    expected = (0.0, 0.0, rate, -0.5 * rate**2 * mean, 0.0, G)
    np.testing.assert_allclose(rows[1:-1, 1:], np.tile(expected, (599, 1)), atol=1e-9)

    times = np.linspace(0.0, 3.0, 61)  # and angular acceleration, of 0.5 rad/s²
    trajectory = Trajectory.on_ground(times, np.zeros((61, 2)), 0.25 * times**2)
    (row,) = readings_of(trajectory, device="ideal", position_m=[0.0, 0.4, 0.0])[300:301, 1:]
    # by the middle the free ends have died out
    np.testing.assert_allclose(row, (0, 0, 0.75, -0.2, -0.4 * 0.75**2, G), atol=1e-6)


def test_on_a_circle_it_feels_the_centripetal_force():
    radius_m, rate, step_s = 3.0, 0.7, 0.05
    times = np.arange(121) * step_s
    circle = radius_m * np.column_stack((np.sin(rate * times), -np.cos(rate * times)))
    trajectory = Trajectory.on_ground(times, circle, rate * times)
    rows = readings_of(trajectory, device="ideal")[300:900, 1:]
    # a cubic spline's second derivative is off by a twelfth of the fourth derivative times step²
    bound = radius_m * rate**4 * step_s**2 / 12.0 * 1.5
    expected = (0.0, 0.0, rate, 0.0, radius_m * rate**2, G)
    np.testing.assert_allclose(rows, np.tile(expected, (600, 1)), atol=bound)


def strapdown(rows, start, velocity_mps):
    """Positions and rotations (n, ...) by integrating readings: the mean of two at a time."""
    rotation, position, velocity = start[:3, :3], start[:3, 3].copy(), velocity_mps.copy()
    positions, rotations = [position.copy()], [rotation]
    for before, after in itertools.pairwise(rows):
        step_s = after[0] - before[0]
        turned = (
            rotation @ Rotation.from_rotvec((before[1:4] + after[1:4]) * step_s / 2).as_matrix()
        )
        force = 0.5 * (rotation @ before[4:] + turned @ after[4:]) - (0.0, 0.0, G)
        position = position + velocity * step_s + 0.5 * force * step_s**2
        velocity, rotation = velocity + force * step_s, turned
        positions.append(position)
        rotations.append(rotation)
    return np.array(positions), np.array(rotations)


def test_strapdown_integration_gives_back_the_poses():
    trajectory = wavy()
    velocity_mps = SplineMotion(trajectory).at(np.zeros(1)).velocity_mps[0]
    found_m, found = [], []
    for rate_hz in (100.0, 200.0):
        rows = readings_of(trajectory, device="ideal", rate_hz=rate_hz)
        positions, rotations = strapdown(rows, trajectory.world_from_base[0], velocity_mps)
        each = round(rate_hz / 10.0)  # readings a pose
        found_m.append(positions[::each])
        found.append(rotations[::each])
    true_m, true = trajectory.positions_m, trajectory.world_from_base[:, :3, :3]
    # 0.18 mm and 0.006 mrad after 4 s, measured
    assert np.abs(found_m[1] - true_m).max() < 3e-4
    change = np.swapaxes(found[1], 1, 2) @ true
    assert Rotation.from_matrix(change).magnitude().max() < 1e-5
    # they are the integration's, of second order: extrapolated to no step at all little is left
    np.testing.assert_allclose((4.0 * found_m[1] - found_m[0]) / 3.0, true_m, atol=3e-6)
    np.testing.assert_allclose((4.0 * found[1] - found[0]) / 3.0, true, atol=1e-7)


def test_stamps_since_1970_make_no_difference():
    trajectory = wavy()
    later = Trajectory(trajectory.times_s + 1.7e9, trajectory.world_from_base)
    near, far = (readings_of(one, device="ideal") for one in (trajectory, later))
    assert len(near) == len(far) == 801
    # a stamp is known to 2.4e-7 s
    np.testing.assert_allclose(near[:, 1:], far[:, 1:], atol=1e-4)


def allan_variance(values, cluster):
    """Allan variance of readings (n, axes) over clusters of so many, and their differences."""
    means = values[: len(values) // cluster * cluster].reshape(-1, cluster, values.shape[1])
    steps = np.diff(means.mean(axis=1), axis=0)
    return 0.5 * np.mean(steps**2), steps.size


@pytest.mark.parametrize("device", ["adis16448", "bmi160"])
def test_allan_deviation_is_the_data_sheets(device):
    errors, rate_hz, count = DEVICES[device], 100.0, 200_000
    values = errors.biases(count, rate_hz, 7) + errors.noise(np.arange(count), rate_hz, 7)
    densities = errors.gyro_noise_radps_per_sqrt_hz, errors.accel_noise_mps2_per_sqrt_hz
    walks = errors.gyro_bias_walk_radps2_per_sqrt_hz, errors.accel_bias_walk_mps3_per_sqrt_hz
    for axes, density, walk in zip((slice(0, 3), slice(3, 6)), densities, walks, strict=True):
        for tau_s in (0.1, 1.0, 10.0, 100.0):
            # slope −1/2 and slope +1/2 of the deviation, IEEE Std 952
            expected = density**2 / tau_s + walk**2 * tau_s / 3.0
            found, differences = allan_variance(values[:, axes], round(tau_s * rate_hz))
            # neighboring differences of white noise correlate by −1/2, which makes 3/n of 2/n
            assert found == pytest.approx(expected, rel=4.0 * math.sqrt(3.0 / differences)), tau_s


def test_noise_and_walk_are_of_their_own_axes_and_times():
    count, rate_hz = 200_000, 100.0
    for errors, at_1_s, at_10_s in (
        (ImuErrors(gyro_noise_radps_per_sqrt_hz=2e-3), 2e-3, 2e-3 / math.sqrt(10.0)),
        (ImuErrors(gyro_bias_walk_radps2_per_sqrt_hz=5e-4), 5e-4 / math.sqrt(3.0),
         5e-4 * math.sqrt(10.0 / 3.0)),
    ):  # fmt: skip
        values = errors.biases(count, rate_hz, 3) + errors.noise(np.arange(count), rate_hz, 3)
        assert not values[:, 3:].any()
        for size, expected in ((100, at_1_s), (1000, at_10_s)):
            variance, n = allan_variance(values[:, :3], size)
            assert math.sqrt(variance) == pytest.approx(expected, rel=2.0 * math.sqrt(3.0 / n))


def test_axes_readings_seeds_and_names_have_noise_of_their_own():
    trajectory = wavy()
    ideal = readings_of(trajectory, device="ideal")
    noise = readings_of(trajectory, accel_bias_sigma_mps2=1.0) - ideal
    correlation = np.corrcoef(noise[:, 1:4].T)
    assert np.all(np.abs(correlation[~np.eye(3, dtype=bool)]) < 5.0 / math.sqrt(len(noise)))
    assert 0.05 < np.abs(noise[:, 4:].mean(axis=0)).max() < 4.0  # of the bias at the start
    for other in (readings_of(trajectory, seed=1), readings_of(trajectory, name="b")):
        assert np.abs(other - ideal)[:, 1:].max() > 0.0
        assert not np.any(other[:, 1:] == (noise + ideal)[:, 1:])


def test_biases_do_not_depend_on_how_many_are_asked_for():
    errors = dataclasses.replace(DEVICES["bmi160"], gyro_bias_sigma_radps=0.1)
    many = errors.biases(120_000, 200.0, 5)
    assert np.array_equal(many[:100_001], errors.biases(100_001, 200.0, 5))
    assert many[0, :3].all()
    rows = readings_of(wavy(), rate_hz=3.0)  # a rate below the steps'
    np.testing.assert_allclose(rows[:, 0], np.arange(13) / 3.0)


@pytest.mark.usefixtures("needs_opengl")
def test_a_run_with_only_an_imu_goes_on_with_the_same_bytes(tmp_path):
    vehicle = dataclasses.replace(vehicle_of(), kinematics=load_robot("p2at").kinematics)
    drive, run = Drive(load_scene("soccer"), vehicle, ROUTE, seed=3), tmp_path / "run"
    steps = list(drive.plan().record(run))[-1]
    (unit,) = vehicle.sensors
    text = (run / "imu" / "sensor.yaml").read_text()
    assert unit.sensor.documents(unit) == {"sensor.yaml": text}
    files = sorted((run / "imu").glob("*.csv"))
    assert [file.name for file in files] == ["biases.csv", "readings.csv", "times.csv"]
    assert files[1].read_text().startswith(f"{COLUMNS}\n0.000000000,")
    before = [file.read_bytes() for file in files]
    for file in files:
        file.unlink()
    assert list(drive.plan().record(run)) == [steps]
    assert [file.read_bytes() for file in files] == before
    biases, rows = (np.loadtxt(file, delimiter=",", skiprows=1) for file in files[:2])
    np.testing.assert_allclose(np.diff(rows[:, 0]), 0.005, atol=2e-9)
    # without its biases and its noise a reading is the motion's
    ideal = dataclasses.replace(unit.sensor, errors=ImuErrors())
    true = ideal.readings(unit, drive.plan().motion, 3, rows[:, 0])
    noise = rows[:, 1:] - true - biases[:, 1:]
    sigmas = np.repeat((1.6968e-4, 2.0e-3), 3) * math.sqrt(200.0)
    np.testing.assert_allclose(noise.std(axis=0), sigmas, rtol=0.05)


def test_parameters_are_in_a_file_like_eurocs():
    (unit,) = vehicle_of(roll_deg=1e-9, position_m=[0.1, 0.2, 0.3]).sensors
    parameters = yaml.safe_load(unit.sensor.documents(unit)["sensor.yaml"])
    pose_of_unit = np.reshape(parameters["T_BS"]["data"], (4, 4))
    np.testing.assert_array_equal(pose_of_unit, unit.base_from_sensor)
    # the numbers of EuRoC's own file
    assert {key: parameters[key] for key in list(parameters)[2:-1]} == {
        "rate_hz": 200.0,
        "gyroscope_noise_density": 1.6968e-04,
        "gyroscope_random_walk": 1.9393e-05,
        "accelerometer_noise_density": 2.0000e-3,
        "accelerometer_random_walk": 3.0000e-3,
    }
    assert parameters["gravity_mps2"] == G
    (unit,) = vehicle_of(device="bmi160").sensors
    parameters = yaml.safe_load(unit.sensor.documents(unit)["sensor.yaml"])
    assert parameters["gyroscope_noise_density"] == 8e-5  # a number, not a text


def test_it_may_be_inside_of_the_body(tmp_path):
    (tmp_path / "robot.toml").write_text(
        'name = "a"\nbody = "body.glb"\n[[sensors]]\nname = "imu"\ntype = "imu"\n'
        "position_m = [0.0, 0.0, 0.15]\n"
    )
    (tmp_path / "body.glb").symlink_to(SCENES / "p2at" / "p2at.glb")
    (imu,) = Vehicle.load(tmp_path).sensors
    assert repr(imu) == "Mount('imu', Imu(200 Hz, gravity 9.80665 m/s²))"


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"rate_hz": 0.0}, "rate_hz"),
        ({"device": "adis"}, "device"),
        ({"gyro_noise_radps_per_sqrt_hz": -1.0}, "gyro_noise_radps_per_sqrt_hz"),
    ],
)
def test_an_imu_that_cannot_be_is_refused(keys, message):
    with pytest.raises(RobotFileError, match=message):
        vehicle_of(**keys)
    days = Trajectory(np.array([0.0, 1e6]), np.stack([np.eye(4)] * 2))
    (imu,) = vehicle_of().sensors
    with pytest.raises(RunError, match=r"sensor 'imu': rate_hz = 200: expected fewer than"):
        imu.times_s(days.times_s, 0)


def test_the_unit_may_be_turned_on_its_robot():
    trajectory, mount = wavy(), pose((0.1, 0.2, 0.3), roll_deg=10.0, pitch_deg=20.0, yaw_deg=30.0)
    motion, times = SplineMotion(trajectory), np.linspace(0.5, 3.5, 50)
    h = 1e-4
    turned = true_readings(motion, mount, G, times, 2 * h)

    # the unit's own path, differentiated by its positions
    def path(at):
        mounted = motion.at(at).world_from_base @ mount
        return mounted[:, :3, 3], mounted[:, :3, :3]

    acceleration = (path(times + h)[0] - 2 * path(times)[0] + path(times - h)[0]) / h**2
    force = np.einsum("nij,ni->nj", path(times)[1], acceleration + (0.0, 0.0, G))
    np.testing.assert_allclose(turned[:, 3:], force, atol=1e-5)
    change = np.swapaxes(path(times - h)[1], 1, 2) @ path(times + h)[1]
    rate = Rotation.from_matrix(change).as_rotvec() / (2 * h)
    np.testing.assert_allclose(turned[:, :3], rate, atol=1e-6)


def test_turns_that_no_smooth_motion_follows_are_refused():
    (imu,) = vehicle_of().sensors
    turns = Trajectory.on_ground(np.arange(3.0), np.zeros((3, 2)), np.radians((0.0, 119.0, 240.0)))
    with pytest.raises(RunError, match="sensor 'imu': step 1 → 2: expected a turn of at most 120°"):
        imu.sensor.check_trajectory(imu, turns, turns.times_s)
    for path in (wavy(), Trajectory(np.zeros(1), np.eye(4)[None])):
        imu.sensor.check_trajectory(imu, path, path.times_s)


def test_wide_turns_have_even_rates():
    """At the widest turns allowed rates do not jump where two pieces of the motion meet."""
    random = np.random.default_rng(0)
    axes = random.standard_normal((30, 3))
    turns = Rotation.from_rotvec(np.radians(119.9) * axes / np.linalg.norm(axes, axis=1)[:, None])
    poses = np.tile(np.eye(4), (31, 1, 1))
    poses[1:, :3, :3] = list(itertools.accumulate(turns.as_matrix(), np.matmul))
    times = np.cumsum(random.uniform(0.1, 1.0, 31))
    motion = SplineMotion(Trajectory(times, poses))
    before, after = (motion.at(times[1:-1] + share).angular_rate_radps for share in (-1e-7, 1e-7))
    np.testing.assert_allclose(before, after, atol=1e-3)
