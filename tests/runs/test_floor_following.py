"""Vehicles on the scene's floor: level and sloping, with steps, joints, holes and ledges."""

import dataclasses

import numpy as np
import pytest

from omnisim.core.errors import TrajectoryError
from omnisim.core.poses import pose
from omnisim.robots.kinematics import GRADE, find_drift, find_violation
from omnisim.robots.motion_profile import Trapezoid
from omnisim.robots.vehicle import Vehicle
from omnisim.runs.route import Route, plan_route
from omnisim.scene import load_scene
from omnisim.scene.model import Material, Mesh, ScenePath
from tests.embree_oracle import RayCaster
from tests.scenes import scene_of

ROUNDING_M = 1e-5  # of heights: `omnisim.scene.space.floor.HEIGHT_DIGITS`
LENGTH_M, WIDTH_M, CLEARANCE_M = 0.626, 0.505, 0.05  # of the Pioneer 2 AT


@pytest.fixture(scope="module")
def vehicle():
    return Vehicle.load("p2at")


def _slab(x0_m, x1_m, z_m, y0_m=-3.0, y1_m=3.0):
    corners = [(x0_m, y0_m, z_m), (x1_m, y0_m, z_m), (x1_m, y1_m, z_m), (x0_m, y1_m, z_m)]
    triangles = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint32)
    return Mesh("slab", np.array(corners, dtype=np.float32), triangles, 0)


def _drive(vehicle, meshes, waypoints=((-1.5, 0.0), (1.5, 0.0)), poses=None, **options):
    scene = scene_of(meshes, [Material()], poses)
    scene = dataclasses.replace(scene, paths=(ScenePath("way", waypoints),))
    return plan_route(scene, vehicle, Route("way", **options)).trajectory


def test_floors_at_0_change_no_byte(vehicle):
    found, level = (
        plan_route(load_scene("soccer"), vehicle, Route("lap", ground_m=ground_m))
        for ground_m in (None, 0.0)
    )
    assert (found.follows_floor, level.follows_floor) == (True, False)
    ours, theirs = found.trajectory, level.trajectory
    assert ours.world_from_base.tobytes() == theirs.world_from_base.tobytes()
    assert ours.times_s.tobytes() == theirs.times_s.tobytes()


def test_level_floors_lift_the_poses_alone(vehicle):
    for z_m in (-0.09, 120.0):
        found = _drive(vehicle, [_slab(-3, 3, z_m)])
        level = _drive(vehicle, [_slab(-3, 3, z_m)], ground_m=z_m)
        np.testing.assert_array_equal(found.world_from_base, level.world_from_base)


def test_the_floor_nearest_to_0_is_the_first(vehicle):
    floors = [_slab(-3, 3, z) for z in (-3.0, 0.3, 2.9)]
    np.testing.assert_array_equal(_drive(vehicle, floors).positions_m[:, 2], 0.3)


def test_objects_beside_the_start_are_no_floor(vehicle):
    """A shelf nearer to 0 than the floor, and a kerb under the wheels of one side."""
    floor = _slab(-3, 3, -0.2)
    for other in (_slab(-1.3, -1.0, 0.0), _slab(-3, 3, -0.1, 0.15, 3.0)):
        found = _drive(vehicle, [floor, other])
        np.testing.assert_allclose(found.positions_m[:, 2], -0.2, atol=ROUNDING_M)


@pytest.mark.parametrize(("roll_deg", "pitch_deg"), [(0.0, -11.0), (4.0, 0.0), (-6.0, 9.0)])
def test_slopes_tilt_the_robot(vehicle, roll_deg, pitch_deg):
    world_from_slope = pose((0.0, 0.0, 0.05), roll_deg=roll_deg, pitch_deg=pitch_deg)
    square = ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0))
    found = _drive(vehicle, [_slab(-3, 3, 0.0)], square, [world_from_slope])
    level = _drive(vehicle, [_slab(-3, 3, 0.0)], square, ground_m=0.0)
    normal = world_from_slope[:3, 2]
    above_m = (found.positions_m - world_from_slope[:3, 3]) @ normal
    np.testing.assert_allclose(above_m, 0.0, atol=2.0 * ROUNDING_M)
    up = found.world_from_base[:, :3, 2]
    np.testing.assert_allclose(up, np.broadcast_to(normal, up.shape), atol=4 * ROUNDING_M / WIDTH_M)
    np.testing.assert_allclose(found.yaw_rad, level.yaw_rad, atol=1e-12)
    np.testing.assert_array_equal(found.positions_m[:, :2], level.positions_m[:, :2])


def test_uneven_ground_is_embree_s(vehicle):
    """Medians of rays around the wheels, and the plane through them by NumPy."""
    random = np.random.default_rng(3)
    ends = np.linspace(-3.0, 3.0, 31)
    x, y = np.meshgrid(ends, ends, indexing="ij")
    corners = np.stack((x, y, random.uniform(-0.03, 0.03, x.shape)), axis=-1).reshape(-1, 3)
    k = (31 * np.arange(30)[:, None] + np.arange(30)).reshape(-1, 1)
    triangles = np.concatenate((k + (0, 31, 32), k + (0, 32, 1))).astype(np.uint32)
    scene = scene_of([Mesh("ground", corners.astype(np.float32), triangles, 0)], [Material()])
    scene = dataclasses.replace(scene, paths=(ScenePath("way", ((-1.5, -1), (1.5, 1), (0, 1.5))),))
    found = plan_route(scene, vehicle, Route("way")).trajectory
    caster, down = RayCaster(scene), np.array([[0.0, 0.0, -1.0]])
    tire = np.array(((0, 0), (-1, -1), (-1, 1), (1, -1), (1, 1))) * 0.05
    for world_from_base, yaw in zip(found.world_from_base, found.yaw_rad, strict=True):
        turn = np.array(((np.cos(yaw), -np.sin(yaw)), (np.sin(yaw), np.cos(yaw))))
        wheels = []
        for ahead in (-LENGTH_M / 2 + 0.05, LENGTH_M / 2 - 0.05):
            for left in (-WIDTH_M / 2 + 0.05, WIDTH_M / 2 - 0.05):
                points = world_from_base[:2, 3] + (np.array((ahead, left)) + tire) @ turn.T
                heights = [5.0 - caster.ranges(np.array((*p, 5.0)), down)[0] for p in points]
                wheels.append((ahead, left, 1.0, np.median(heights)))
        *system, heights = np.array(wheels).T
        (along, across, z_m), *_ = np.linalg.lstsq(np.array(system).T, heights)
        assert world_from_base[2, 3] == pytest.approx(z_m, abs=2 * ROUNDING_M)
        up = np.array((*(turn @ (-along, -across)), 1.0))
        up /= np.linalg.norm(up)
        # the wheels' heights are rounded, and half a meter apart
        np.testing.assert_allclose(world_from_base[:3, 2], up, atol=4 * ROUNDING_M / 0.4)


def test_low_steps_are_climbed_and_high_ones_are_not(vehicle):
    for height_m, wanted_m in ((0.04, 0.04), (0.2, 0.0)):
        found = _drive(vehicle, [_slab(-3, 3, 0.0), _slab(0.0, 3.0, height_m)])
        assert found.positions_m[-1, 2] == pytest.approx(wanted_m, abs=ROUNDING_M)
        assert found.positions_m[0, 2] == 0.0


@pytest.mark.parametrize("rate_hz", [None, 1.0, 30.0])
def test_slopes_and_steps_are_no_slides(vehicle, rate_hz):
    """Stairs of steps that can be climbed and the steepest slope, as limits of drift see them."""
    stairs = [_slab(-3, 3, 0.0), *(_slab(0.35 * k, 3, 0.04 * (k + 1)) for k in range(4))]
    climbed = _drive(vehicle, stairs, rate_hz=rate_hz)
    assert climbed.positions_m[-1, 2] == pytest.approx(0.16, abs=ROUNDING_M)
    steep = pose(pitch_deg=-np.degrees(np.arctan(GRADE)))
    slope = _drive(vehicle, [_slab(-3, 3, 0.0)], poses=[steep], rate_hz=rate_hz)
    assert find_drift(climbed) is find_drift(slope) is None


@pytest.mark.parametrize(("robot", "grade"), [("p2at", 0.1), ("superscout", 0.4)])
def test_speeds_along_slopes_are_within_the_limits(robot, grade):
    """From a level floor up a ramp: from rest to rest along the floor, as along a level one."""
    vehicle = Vehicle.load(robot)
    ramp = _slab(0, 3, 0.0)
    ramp.positions[:, 2] = grade * ramp.positions[:, 0]
    found = _drive(vehicle, [_slab(-3, 0, 0.0), ramp])
    level = _drive(vehicle, [_slab(-3, 3, 0.0)])
    limits = vehicle.kinematics
    assert find_violation(found, limits) is None
    ways_m = found.step_lengths_m
    law = Trapezoid(ways_m.sum(), limits.max_speed_mps, limits.max_acceleration_mps2)
    np.testing.assert_allclose(np.cumsum(ways_m), law.amounts_at(found.times_s[1:]), atol=1e-6)
    on_ramp = level.positions_m[:-1, 0] > 0.5
    np.testing.assert_allclose(
        (ways_m / level.step_lengths_m)[on_ramp],
        np.hypot(1.0, grade),
        rtol=ROUNDING_M / level.step_lengths_m.min(),
    )


def test_door_sills_are_within_the_limits(vehicle):
    found = plan_route(load_scene("mapping"), vehicle, Route("round")).trajectory
    assert found.path_length_m > 30.0
    np.testing.assert_allclose(found.positions_m[0], found.positions_m[-1], atol=1e-9)
    assert found.positions_m[:, 2].max() == pytest.approx(0.003, abs=ROUNDING_M)  # two of 6 mm
    assert find_violation(found, vehicle.kinematics) is None


def test_a_robot_on_a_step_leans_back(vehicle):
    found = _drive(vehicle, [_slab(-3, 3, 0.0), _slab(0.0, 3.0, 0.04)], step_m=0.05)
    half_m = LENGTH_M / 2 - 0.05  # between the wheels and the middle
    astride = np.abs(found.positions_m[:, 0]) < half_m - 0.05
    assert astride.any()
    np.testing.assert_allclose(found.positions_m[astride, 2], 0.02, atol=ROUNDING_M)
    np.testing.assert_allclose(
        found.world_from_base[astride, 2, 0], np.sin(np.arctan(0.04 / (2 * half_m))), atol=1e-4
    )


@pytest.mark.parametrize("wide_m", [0.02, 0.2])
def test_joints_gaps_and_a_hole_at_one_side_are_bridged(vehicle, wide_m):
    """Gaps of less than half its length: its middle or three wheels are then on the floor."""
    floor = [_slab(-3, 0, 0.0), _slab(wide_m, 3, 0.0)]
    for meshes in (floor, [*floor, _slab(-3, 3, -0.5)], [_slab(-3, 3, 0.0, -0.2, 3.0)]):
        found = _drive(vehicle, meshes)
        np.testing.assert_allclose(found.positions_m[:, 2], 0.0, atol=ROUNDING_M)


def test_a_wheel_over_a_hole_is_on_the_slope_of_the_others(vehicle):
    around = [
        _slab(-3, 0, 0),
        _slab(0.2, 3, 0),
        _slab(0, 0.2, 0, -0.1),
        _slab(0, 0.2, 0, y1_m=-0.4),
    ]
    uphill = [pose(pitch_deg=-np.degrees(np.arctan(0.2)))] * len(around)
    found = _drive(vehicle, around, poses=uphill, step_m=0.05)
    edge_m = 0.2 * 0.05 / 4  # a tire half over the hole, 0.05 m in size, is one wheel of four
    x_m, _, z_m = found.positions_m.T
    np.testing.assert_allclose(z_m, 0.2 * x_m, atol=edge_m + ROUNDING_M)


def test_ledges_and_ends_of_the_floor_are_refused(vehicle):
    """At the step before the robot's middle is beyond."""
    ends = [_slab(-3, 0.5, 0.0), _slab(2.9, 3.0, 0.0)]
    for floor in (ends, [*ends, _slab(-3, 3, -0.2)]):
        with pytest.raises(TrajectoryError) as reason:
            _drive(vehicle, floor)
        assert str(reason.value) == (
            "way: leaves the floor at step 5, (0.52, 0.00) m: expected floor within 0.05 m of "
            "0.00 m: --ground M drives at one height"
        )
        assert len(_drive(vehicle, floor, ground_m=0.0)) == 9
    ceiling = dataclasses.replace(_slab(-3, 3, 2.0), triangles=_slab(-3, 3, 2.0).triangles[:, ::-1])
    with pytest.raises(TrajectoryError, match=r"leaves the floor at step 0, \(-1\.50, 0\.00\)"):
        _drive(vehicle, [ceiling])


def test_clearance_is_the_robot_file_s(vehicle):
    high = dataclasses.replace(vehicle.footprint, clearance_m=0.25)
    on_wheels = dataclasses.replace(vehicle, footprint=high)
    found = _drive(on_wheels, [_slab(-3, 3, 0.0), _slab(0.0, 3.0, 0.2)])
    assert found.positions_m[-1, 2] == pytest.approx(0.2, abs=ROUNDING_M)


def test_robots_of_unknown_size_follow_their_middle(vehicle):
    point = dataclasses.replace(vehicle, footprint=None, body=None)
    found = _drive(point, [_slab(-3, 3, 0.0)], poses=[pose((0.0, 0.0, 0.3), pitch_deg=-10.0)])
    wanted = 0.3 + np.tan(np.radians(10.0)) * found.positions_m[:, 0]
    np.testing.assert_allclose(found.positions_m[:, 2], wanted, atol=ROUNDING_M)
    np.testing.assert_array_equal(found.world_from_base[:, :3, 2], np.eye(3)[[2] * len(found)])


def test_poses_of_a_floor_plan_follow_and_others_do_not(vehicle, tmp_path):
    scene = scene_of([_slab(-3, 3, -0.09)], [Material()])
    for columns, end, z_m in (("yaw_deg", "0", -0.09), ("z_m", "0", 0.0), ("z_m", "0.2", 0.2)):
        file = tmp_path / "poses.csv"
        file.write_text(f"x_m,y_m,{columns}\n0,0,{end}\n0.1,0,{end}\n")
        found = plan_route(scene, vehicle, Route(str(file)))
        assert found.follows_floor == (columns == "yaw_deg")
        np.testing.assert_array_equal(found.trajectory.positions_m[:, 2], z_m)


def test_heights_are_noted(vehicle):
    scene = dataclasses.replace(
        scene_of([_slab(-3, 3, -0.09)], [Material()]),
        paths=(ScenePath("way", ((-1.0, 0.0), (1.0, 0.0))),),
    )
    notes = []
    plan_route(scene, vehicle, Route("way"), notes.append)
    plan_route(scene, vehicle, Route("way", ground_m=0.0), notes.append)
    assert notes == ["way: on the floor, at -0.09 m; --ground M drives at one height"]
