"""Drives in MuJoCo: paths, contacts, objects that are pushed, odometry, and refusals."""

import dataclasses
import json

import numpy as np
import pytest
import trimesh

pytest.importorskip("mujoco", reason="MuJoCo, an extra, is not installed")

from omnisim.core.errors import OmnisimError, RunError, TrajectoryError
from omnisim.core.poses import rotation_angles
from omnisim.core.trajectories import Trajectory, read_trajectory, write_trajectory
from omnisim.robots.vehicle import Vehicle
from omnisim.runs.drive import Drive, drive_together, plan_together
from omnisim.runs.route import Route
from omnisim.scene.model import DynamicObject, ScenePath
from omnisim.scene.motion.object_motion import Rest, Shuttle
from tests.runs.physics.worlds import ball, hall, robot, solid


def _drive(scene, waypoints_m, drive="skid_steer", **options):
    scene = dataclasses.replace(scene, paths=(ScenePath("way", tuple(waypoints_m), None),))
    found = robot(drive)
    route = Route("way", step_m=0.2, step_deg=20.0, **options)
    return Drive(scene, Vehicle.from_robot(found), route, physics=found.chassis)


SQUARE = ((0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0), (0.0, 0.0))


@pytest.mark.parametrize("drive", ["skid_steer", "differential"])
def test_a_square_is_driven_as_planned_and_dead_reckoning_has_the_slip(drive):
    wanted = _drive(hall(), SQUARE, drive)
    plan = wanted.plan()
    planned = dataclasses.replace(wanted, physics=None).plan()
    np.testing.assert_array_equal(plan.truth.times_s, planned.truth.times_s)
    distances_m = np.linalg.norm(plan.truth.positions_m - planned.truth.positions_m, axis=1)
    assert distances_m.max() < 0.02
    assert plan.contacts == ()
    # readings without errors: what is left is slip, of 0.2 % ahead, and of a skid's quick turns
    end = plan.odometry.planar_poses[-1]
    slip_m = np.linalg.norm(end[:2] - plan.truth.positions_m[-1, :2])
    assert slip_m < (0.02 if drive == "differential" else 0.5)
    assert 0.0 < plan.simulated.slip.distance < 2e-3
    assert abs(plan.simulated.slip.turn) < (3e-3 if drive == "differential" else 0.06)


def test_the_same_drive_has_the_same_bytes():
    wanted = _drive(hall(), SQUARE[:2])
    first, second = wanted.plan(), wanted.plan()
    for one, other in ((first.truth, second.truth), (first.simulated.base, second.simulated.base)):
        assert one.world_from_base.tobytes() == other.world_from_base.tobytes()
    assert first.odometry.turns_rad.tobytes() == second.odometry.turns_rad.tobytes()
    assert first.simulated.manifest() == second.simulated.manifest()


def test_a_wall_stops_the_robot():
    wall = solid(trimesh.creation.box((0.1, 4.0, 1.0)))
    scene = hall(("wall", wall, (1.5, 0.0, 0.5)))
    with pytest.raises(TrajectoryError, match=r"cannot follow against wall: expected at most 0\.5"):
        _drive(scene, SQUARE[:2]).plan()
    plan = _drive(scene, SQUARE[:2], ignore_limits=True).plan()
    (contact,) = plan.contacts
    assert contact.object == "wall"
    assert contact.position_m[0] == pytest.approx(1.45 - 0.3, abs=0.02)
    assert plan.truth.positions_m[-1, 0] == pytest.approx(1.45 - 0.3, abs=0.02)
    # wheels spin on the spot: odometry does not know
    assert plan.odometry.planar_poses[-1, 0] > 1.5


def test_a_ball_that_is_hit_rolls_ahead():
    scene = dataclasses.replace(hall(), objects=(ball((1.0, 0.0, 0.1)),))
    plan = _drive(scene, SQUARE[:2]).plan()
    (contact,) = plan.contacts
    assert contact.object == "ball"
    motion = plan.simulated.objects["ball"]
    hit = int(np.searchsorted(motion.times_s, contact.time_s))
    np.testing.assert_allclose(motion.positions_m[: hit - 2, 0], 1.0, atol=1e-3)
    # a robot of 10 kg pushes a ball of 0.4 kg: between its own speed, and twice as fast
    robot_mps = np.diff(plan.simulated.base.positions_m[hit - 20 : hit, 0]).mean() * 200.0
    ball_mps = np.diff(motion.positions_m[hit + 40 : hit + 60, 0]).mean() * 200.0
    assert 0.9 * robot_mps < ball_mps < 2.0 * robot_mps
    late = slice(-100, None)
    rolled = np.linalg.norm(np.diff(motion.positions_m[late], axis=0), axis=1).sum()
    turned = motion.world_from_base[late, :3, :3]
    angles = rotation_angles(turned[:-1], turned[1:])
    assert np.abs(angles).sum() * 0.1 == pytest.approx(rolled, rel=0.01)  # without slipping
    np.testing.assert_allclose(motion.positions_m[:, 2], 0.1, atol=2e-3)
    # the world that is rendered has it, too
    state = plan.world.state_at(float(plan.truth.times_s[-1])).world_from_object
    assert state["ball"][0, 3] == pytest.approx(motion.positions_m[-1, 0], abs=0.01)


def test_a_robot_that_tips_over_is_refused():
    wanted = _drive(hall(), SQUARE)
    fast = {"max_speed_mps": 3.0, "max_acceleration_mps2": 6.0}
    limits = dataclasses.replace(wanted.vehicle.kinematics, **fast)
    vehicle = dataclasses.replace(wanted.vehicle, kinematics=limits)
    physics = dataclasses.replace(wanted.physics, center_height_m=2.0)
    with pytest.raises(TrajectoryError, match=r"way: at \d.* m: the robot tips over"):
        dataclasses.replace(wanted, vehicle=vehicle, physics=physics).plan()


def test_refusals_are_one_line(monkeypatch):
    wanted = _drive(hall(), SQUARE[:2])
    for changes, words in (
        ({"vehicle": dataclasses.replace(wanted.vehicle, footprint=None)},
         r"expected a \[footprint\] or a body with --physics"),
        ({"vehicle": dataclasses.replace(wanted.vehicle, kinematics=None)},
         r"expected \[kinematics\] with --physics"),
        ({"route": dataclasses.replace(wanted.route, ground_m=1.0)},
         "--ground: expected none with --physics"),
    ):  # fmt: skip
        with pytest.raises(TrajectoryError, match=words):
            dataclasses.replace(wanted, **changes).plan()
    monkeypatch.setattr("omnisim.runs.physics.simulation.MAX_PIECES", 0)
    with pytest.raises(TrajectoryError, match="floor: expected at most 0 convex pieces about the"):
        wanted.plan()
    monkeypatch.setattr("omnisim.core.extras.is_installed", lambda module: module != "mujoco")
    with pytest.raises(OmnisimError, match="--physics needs mujoco-core: pip install"):
        wanted.plan()


def test_a_drive_that_was_stopped_goes_on_with_the_same_bytes(tmp_path, needs_opengl):
    scene = dataclasses.replace(hall(), objects=(ball((1.0, 0.0, 0.1)),))
    wanted = dataclasses.replace(_drive(scene, SQUARE[:2]), vehicle=Vehicle.from_robot(_seeing()))
    list(wanted.plan().record(tmp_path / "whole"))
    stopped = wanted.plan().record(tmp_path / "stopped")
    for _ in range(4):
        next(stopped)
    stopped.close()
    list(wanted.plan().record(tmp_path / "stopped"))
    files = [one for one in (tmp_path / "whole").rglob("*") if one.is_file()]
    assert len(files) > 14
    for file in files:
        other = tmp_path / "stopped" / file.relative_to(tmp_path / "whole")
        assert other.read_bytes() == file.read_bytes(), file
    manifest = json.loads((tmp_path / "whole" / "manifest.json").read_text())
    assert manifest["physics"]["engine"].startswith("mujoco ")
    assert manifest["physics"]["chassis"]["mass_kg"] == 10.0
    assert manifest["path"]["contacts"][0]["object"] == "ball"
    with pytest.raises(RunError, match="another run is in this folder"):
        list(dataclasses.replace(wanted, physics=None).plan().record(tmp_path / "whole"))
    path = tmp_path / "whole" / "ground_truth.tum"
    recorded = read_trajectory(path)
    poses = recorded.world_from_base.copy()
    poses[-1, 0, 3] += 0.01
    write_trajectory(path, Trajectory(recorded.times_s, poses))
    with pytest.raises(RunError, match=r"ground_truth.tum: .* diverges from it by 0.01 m"):
        list(wanted.plan().record(tmp_path / "whole"))


def _seeing():
    """The robot with an IMU, whose readings are of the motion between the steps, and a sonar."""
    place = {"position_m": [0.0, 0.0, 0.1]}
    imu = {"name": "imu", "type": "imu", "device": "ideal", **place}
    sonar = {"name": "sonar", "type": "usarsim_sonar", **place}
    return robot().model_copy(update={"sensors": (imu, sonar)})


def test_the_imu_feels_gravity_and_the_motion_of_the_simulation(tmp_path, needs_opengl):
    wanted = dataclasses.replace(_drive(hall(), SQUARE[:2]), vehicle=Vehicle.from_robot(_seeing()))
    plan = wanted.plan()
    list(plan.record(tmp_path / "run"))
    readings = np.loadtxt(tmp_path / "run" / "imu" / "readings.csv", delimiter=",", skiprows=1)
    assert len(readings) == pytest.approx(200.0 * plan.truth.duration_s, abs=2)
    assert readings[:, 6].mean() == pytest.approx(9.80665, rel=1e-4)
    # even acceleration by 0.5 m/s² over the first second, then braking by as much at the end
    assert np.median(readings[20:180, 4]) == pytest.approx(0.5, abs=0.02)
    assert np.median(readings[-180:-20, 4]) == pytest.approx(-0.5, abs=0.02)
    speed = np.cumsum(readings[:, 4]) / 200.0
    assert speed[-1] == pytest.approx(0.0, abs=0.02)


def test_wheels_climb_a_ramp():
    slope = np.radians(12.0)
    ramp = trimesh.creation.box((3.0, 3.0, 0.2))
    ramp.apply_transform(trimesh.transformations.rotation_matrix(-slope, (0.0, 1.0, 0.0)))
    top_m = 0.1 / np.cos(slope)  # of its upper side, above its middle
    scene = hall(("ramp", solid(ramp), (2.0, 0.0, 1.0 * np.tan(slope) - top_m)))
    plan = _drive(scene, ((0.0, 0.0), (2.5, 0.0))).plan()
    end = plan.truth.world_from_base[-1]
    assert end[2, 3] == pytest.approx((end[0, 3] - 1.0) * np.tan(slope), abs=0.01)
    assert end[2, 0] == pytest.approx(np.sin(slope), abs=0.005)  # its nose is up


def test_poses_of_a_file_are_followed_backwards_too(tmp_path):
    times_s = 0.2 * np.arange(41)
    x = 0.5 - 0.5 * np.cos(2.0 * np.pi * times_s / 8.0)
    poses = np.repeat(np.eye(4)[None], len(x), axis=0)
    poses[:, 0, 3] = x
    write_trajectory(tmp_path / "way.tum", Trajectory(times_s, poses))
    wanted = _drive(hall(), SQUARE[:2])
    route = dataclasses.replace(wanted.route, path=str(tmp_path / "way.tum"))
    plan = dataclasses.replace(wanted, route=route).plan()
    np.testing.assert_allclose(plan.truth.positions_m[:, 0], x, atol=0.01)
    assert plan.odometry.distances_m[-5:].max() < 0.0


def test_objects_that_move_push_those_that_are_free():
    cart = solid(trimesh.creation.box((0.4, 0.4, 0.4)), "cart")
    shuttle = Shuttle((-3.0, 2.0, 0.25), (0.0, 2.0, 0.25), 8.0)
    moving = DynamicObject("cart", cart, shuttle)
    scene = dataclasses.replace(hall(), objects=(moving, ball((-1.0, 2.0, 0.1))))
    plan = _drive(scene, ((0.0, 0.0), (2.0, 0.0), (0.0, 0.0))).plan()
    assert plan.truth.duration_s > 5.0
    rolled = plan.simulated.objects["ball"].positions_m
    assert np.abs(rolled[:50] - (-1.0, 2.0, 0.1)).max() < 2e-3
    assert rolled[-1, 0] > -0.3  # ahead of the cart's end
    np.testing.assert_allclose(rolled[:, 1], 2.0, atol=0.05)
    assert "cart" not in plan.simulated.objects
    assert plan.contacts == ()


def test_a_robot_hits_an_object_that_rests_without_a_mass():
    shape = solid(trimesh.creation.box((0.1, 0.1, 1.0)))
    scene = dataclasses.replace(
        hall(), objects=(DynamicObject("post", shape, Rest((1.0, 0.0, 0.5))),)
    )
    with pytest.raises(TrajectoryError, match="cannot follow against post"):
        _drive(scene, SQUARE[:2]).plan()


def test_robots_meet_each_other_in_one_world():
    """Head-on at the same speed, robots of the same mass stop each other half-way."""
    ways = {"east": ((-2.0, 0.0), (2.0, 0.0)), "west": ((2.0, 0.0), (-2.0, 0.0))}
    paths = tuple(ScenePath(name, way, None) for name, way in ways.items())
    scene = dataclasses.replace(hall(), paths=paths)
    found = robot("differential")
    vehicle = Vehicle.from_robot(found)
    drives = {
        name: Drive(scene, vehicle, Route(name, ignore_limits=True), physics=found.chassis)
        for name in ("east", "west")
    }
    plans = plan_together(drives)
    east, west = plans["east"], plans["west"]
    np.testing.assert_array_equal(east.simulated.base.times_s, west.simulated.base.times_s)
    for plan, other in ((east, "west"), (west, "east")):
        (contact,) = plan.contacts
        assert contact.object == other
        assert abs(contact.position_m[0]) == pytest.approx(0.3, abs=0.02)  # half of a length
    gap_m = west.truth.positions_m[-1, 0] - east.truth.positions_m[-1, 0]
    assert gap_m == pytest.approx(0.6, abs=0.02)
    # each is where it was simulated in the other's images
    worlds = {name: plan.world for name, plan in drive_together(plans).items()}
    for time_s in (0.0, 2.505, 4.0):
        states = [world.state_at(time_s).world_from_object for world in worlds.values()]
        for name, plan in plans.items():
            for state in states:
                np.testing.assert_array_equal(state[name], plan.motion.pose_at(time_s))


def test_a_robot_alone_drives_as_beside_one_that_is_far_away():
    ways = {"near": ((0.0, 0.0), (1.0, 0.0)), "far": ((0.0, 6.0), (3.0, 6.0))}
    paths = tuple(ScenePath(name, way, None) for name, way in ways.items())
    scene, found = dataclasses.replace(hall(), paths=paths), robot()
    near, far = (
        Drive(scene, Vehicle.from_robot(found), Route(name), physics=found.chassis)
        for name in ("near", "far")
    )
    alone, beside = near.plan(), plan_together({"a": near, "b": far})["a"]
    assert beside.simulated.base.times_s[-1] > alone.simulated.base.times_s[-1] + 1.0
    np.testing.assert_allclose(beside.truth.world_from_base, alone.truth.world_from_base, atol=1e-4)
    # it rests when it has arrived
    end = beside.simulated.base.positions_m[len(alone.simulated.base) :]
    assert np.abs(end - end[0]).max() < 1e-3
