"""One motion: what a noise-free IMU measures along every built-in path integrates to the truth."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from omnisim.core.poses import pose
from omnisim.core.trajectories import Trajectory, write_trajectory
from omnisim.core.trajectories.body_motion import SplineMotion
from omnisim.robots import load_robot
from omnisim.robots.vehicle import Vehicle
from omnisim.runs.drive import Drive
from omnisim.runs.route import Route, follow_floor
from omnisim.scene import load_scene
from omnisim.sensors.imu.imu import true_readings

G = 9.80665
PATHS = [("soccer", "lap"), ("soccer", "lap_clockwise"), ("mapping", "round")]
STEPS = [{}, {"rate_hz": 10.0}]
MOUNTS = [np.eye(4), pose((0.2, 0.1, 0.15), roll_deg=10.0, pitch_deg=20.0, yaw_deg=30.0)]


def integrate(times_s, readings, start, velocity_mps):
    """Poses by the trapezoidal rule, from a pose and a velocity."""
    steps_s = np.diff(times_s)
    turns = Rotation.from_rotvec(0.5 * (readings[:-1, :3] + readings[1:, :3]) * steps_s[:, None])
    rotations = [start[:3, :3]]
    for turn in turns.as_matrix():
        rotations.append(rotations[-1] @ turn)
    rotations = np.array(rotations)
    forces = np.einsum("nij,nj->ni", rotations, readings[:, 3:]) - (0.0, 0.0, G)
    means = 0.5 * (forces[:-1] + forces[1:]) * steps_s[:, None]
    velocities = velocity_mps + np.concatenate((np.zeros((1, 3)), np.cumsum(means, axis=0)))
    moves = (velocities[:-1] + 0.5 * means) * steps_s[:, None]
    places = start[:3, 3] + np.concatenate((np.zeros((1, 3)), np.cumsum(moves, axis=0)))
    return places, rotations


def check(motion, mount, turn_deg=0.01):
    times = np.arange(motion.start_s, motion.end_s, 0.005)
    readings = true_readings(motion, mount, G, times, 0.005)
    truth = motion.at(times).at_mount(mount)
    assert np.abs(truth.velocity_mps[0]).max() < 1e-6
    places, rotations = integrate(times, readings, truth.world_from_base[0], np.zeros(3))
    errors_m = np.linalg.norm(places - truth.world_from_base[:, :3, 3], axis=1)
    assert errors_m.max() < 1e-3
    changes = np.swapaxes(rotations, 1, 2) @ truth.world_from_base[:, :3, :3]
    errors_deg = np.degrees(Rotation.from_matrix(changes).magnitude())
    assert errors_deg.max() < turn_deg
    assert errors_deg[-1] < 0.01


@pytest.mark.parametrize(("scene", "path"), PATHS)
def test_readings_integrate_to_the_pose_over_every_lap(scene, path):
    vehicle = Vehicle.load("p2at")
    for steps in STEPS:
        plan = Drive(load_scene(scene), vehicle, Route(path, **steps)).plan()
        # the motion goes through the poses that are recorded
        poses = plan.motion.at(plan.truth.times_s).world_from_base
        np.testing.assert_allclose(poses, plan.truth.world_from_base, atol=1e-12)
        for mount in MOUNTS:
            check(plan.motion, mount)


def test_no_built_in_path_is_left_out():
    scenes = {name: load_scene(name).paths for name in ("soccer", "courtyard", "mapping")}
    assert {(name, path.name) for name, paths in scenes.items() for path in paths} == set(PATHS)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "path"),
    [pytest.param(*path, marks=() if path == PATHS[1] else pytest.mark.long) for path in PATHS],
)
def test_readings_integrate_to_the_pose_in_physics(scene, path):
    pytest.importorskip("mujoco")
    robot = load_robot("p2at")
    drive = Drive(load_scene(scene), Vehicle.load("p2at"), Route(path), physics=robot.chassis)
    # over an edge of 3 mm wheels bounce faster than 200 Hz follows, for some readings
    check(drive.plan().motion, MOUNTS[1], turn_deg=0.05 if scene == "mapping" else 0.01)


def test_readings_integrate_to_the_pose_along_a_file(tmp_path):
    vehicle, scene = Vehicle.load("p2at"), load_scene("soccer")
    truth = Drive(scene, vehicle, Route("lap", rate_hz=10.0)).plan().truth
    write_trajectory(tmp_path / "lap.tum", truth)
    plan = Drive(scene, vehicle, Route(str(tmp_path / "lap.tum"))).plan()
    check(plan.motion, MOUNTS[1])


def test_readings_integrate_to_the_pose_along_waypoints_in_the_courtyard(tmp_path):
    (tmp_path / "way.csv").write_text("x_m,y_m\n-6,-6\n6,-6\n6,6\n-6,6\n-6,-6\n")
    route = Route(str(tmp_path / "way.csv"))
    check(Drive(load_scene("courtyard"), Vehicle.load("p2at"), route).plan().motion, MOUNTS[1])


def test_a_drive_begins_at_rest_and_feels_gravity_before_it():
    motion = Drive(load_scene("soccer"), Vehicle.load("p2at"), Route("lap")).plan().motion
    before = np.array([-0.2, -0.1, -0.005])
    states = motion.at(before)
    assert not states.velocity_mps.any()
    assert not states.angular_rate_radps.any()
    # a reading at the start already has the acceleration that follows it, and no velocity
    first = true_readings(motion, np.eye(4), G, np.zeros(1), 0.005)[0]
    np.testing.assert_allclose(first[3:], (0.5, 0.0, G), atol=1e-9)


def test_on_a_slope_speed_and_acceleration_hold_along_the_floor(monkeypatch):
    """Waves of 20 cm in a floor of the test's own: the limits hold along it, from any time on."""
    import omnisim.runs.route as route_module

    def wavy(scene, sweep, box, where):
        grounded = follow_floor(scene, sweep, box, where)
        poses = grounded.world_from_base.copy()
        poses[:, 2, 3] += 0.2 * np.sin(poses[:, 0, 3])
        return type(grounded)(poses, grounded.steps, grounded.is_step, grounded.times_s)

    monkeypatch.setattr(route_module, "follow_floor", wavy)
    vehicle, scene = Vehicle.load("p2at"), load_scene("soccer")
    plan = Drive(scene, vehicle, Route("lap")).plan()
    assert np.ptp(plan.truth.positions_m[:, 2]) > 0.2
    states = plan.motion.at(np.linspace(0.0, plan.motion.end_s, 100_001))
    speeds = np.linalg.norm(states.velocity_mps, axis=1)
    # chords of 5 cm are short of their arcs by less than this
    assert speeds.max() < 1.001 * vehicle.kinematics.max_speed_mps
    along = np.einsum("ni,ni->n", states.velocity_mps, states.acceleration_mps2)
    moving = speeds > 1e-2
    limit = vehicle.kinematics.max_acceleration_mps2
    assert np.abs(along[moving] / speeds[moving]).max() < 1.02 * limit
    check(plan.motion, MOUNTS[1])


def test_a_motion_that_begins_on_the_move_is_not_stopped_first():
    times = np.linspace(0.0, 2.0, 21)
    ahead = np.column_stack((times, 0.0 * times))
    motion = SplineMotion(Trajectory.on_ground(times, ahead, 0.0 * times))
    readings = true_readings(motion, np.eye(4), G, np.linspace(0.0, 2.0, 401), 0.005)
    np.testing.assert_allclose(readings[:, 3:], [(0.0, 0.0, G)] * 401, atol=1e-9)
