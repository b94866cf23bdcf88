"""Contacts of a vehicle's body with the scene: boxes and triangles, drives, and refusals."""

import dataclasses

import numpy as np
import pytest
from scipy.optimize import linprog

from omnisim.core.errors import TrajectoryError
from omnisim.core.poses import pose
from omnisim.core.trajectories import Trajectory, write_trajectory
from omnisim.robots.vehicle import BodyBoxes, Vehicle
from omnisim.runs.contacts import SPACING_M, Sweep, check_no_contact, meet_box
from omnisim.runs.drive import Drive
from omnisim.runs.route import Route
from omnisim.scene import load_scene
from omnisim.scene.model import Instance, ScenePath
from tests.scenes import WAREHOUSE, needs_warehouse, scene_of, square
from tests.vehicles import box

HALF_M = np.array([0.3, 0.2, 0.1])


@pytest.fixture(scope="module")
def vehicle():
    return Vehicle.load("superscout")  # 0.41 × 0.41 × 0.66 m, 0.05 m above the ground


def _has_common_point(corners):
    """A linear program: weights of the corners whose mean is in the box."""
    rows = np.concatenate((corners.T, -corners.T))
    found = linprog(
        np.zeros(3), rows, np.tile(HALF_M, 2), np.ones((1, 3)), [1.0], bounds=[(0.0, 1.0)] * 3
    )
    return found.status == 0


def test_boxes_and_triangles_meet_where_a_linear_program_finds_a_point():
    random = np.random.default_rng(11)
    middles = random.uniform(-2.0, 2.0, (200, 1, 3)) * HALF_M
    corners = middles + random.normal(0.0, 0.25, (200, 3, 3))
    found = meet_box(corners, HALF_M)
    np.testing.assert_array_equal(found, [_has_common_point(corner) for corner in corners])
    assert 50 < found.sum() < 150


def test_box_inside_a_large_triangle_and_triangle_inside_the_box():
    large = 100.0 * np.array([[[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]]])
    np.testing.assert_array_equal(meet_box(large, HALF_M), True)
    np.testing.assert_array_equal(meet_box(large + (0.0, 0.0, 0.11), HALF_M), False)
    np.testing.assert_array_equal(meet_box(large * 1e-4, HALF_M), True)
    np.testing.assert_array_equal(meet_box(large * 0.0, HALF_M), True)  # without area


def _scene(*objects):
    """A floor, and boxes with half sizes (3,) about points."""
    meshes = [square(), *(box("box", 0) for _ in objects)]
    poses = [np.eye(4)]
    poses += [pose(at) @ np.diag([*(2.0 * np.array(half)), 1.0]) for at, half in objects]
    names = ["floor", *(f"crate {k}" for k in range(len(objects)))]
    scene = scene_of(meshes, poses=poses)
    instances = tuple(
        dataclasses.replace(instance, name=name)
        for instance, name in zip(scene.instances, names, strict=True)
    )
    way = ScenePath("way", ((-2.0, 0.0), (2.0, 0.0)))
    return dataclasses.replace(scene, instances=instances, paths=(way,))


def _contacts(scene, vehicle, **options):
    return Drive(scene, vehicle, Route("way", **options)).plan().contacts


@pytest.mark.parametrize("step_m", [0.1, 1.0])
def test_first_contact_with_a_thin_pole(vehicle, step_m):
    """Between two steps, too; its time is that of the middle between the poses there."""
    scene = _scene(((0.5, 0.1, 0.5), (0.01, 0.01, 0.5)))
    plan = Drive(scene, vehicle, Route("way", step_m=step_m)).plan()
    (contact,) = plan.contacts
    x, y = contact.position_m
    first_m = 0.49 - 0.205  # the pole's near side, less half of the robot
    assert contact.object == "crate 0"
    assert first_m <= x < first_m + SPACING_M
    assert y == 0.0
    xs, times = plan.truth.positions_m[:, 0], plan.truth.times_s
    assert contact.step == np.searchsorted(xs, x, side="right") - 1
    assert contact.time_s == pytest.approx(np.interp(x, xs, times))
    # the body passes it within 0.43 m
    assert contact.steps == (1 if step_m == 1.0 else pytest.approx(0.43 / 0.1, abs=1.0))


@pytest.mark.parametrize(
    ("top_m", "bottom_m", "touches"),
    [(0.04, 0.0, False), (0.08, 0.0, True), (0.8, 0.67, False), (0.8, 0.65, True)],
)
def test_clearance_and_height(vehicle, top_m, bottom_m, touches):
    """The wheels climb onto what is lower than the clearance."""
    middle, half = (top_m + bottom_m) / 2, (top_m - bottom_m) / 2
    scene = _scene(((0.5, 0.0, middle), (1.0, 1.0, half)))
    assert bool(_contacts(scene, vehicle)) == touches


def test_nodes_of_the_body_touch_each_for_itself(vehicle):
    """A board beside the Pioneer's mast and above its wheels; its footprint's box would meet it."""
    pioneer = Vehicle.load("p2at")
    for y_m, touches in ((0.2, False), (0.15, True)):  # the antenna's tip is 0.139 m to the left
        scene = _scene(((0.5, y_m, 0.35), (0.1, 0.02, 0.05)))
        assert bool(_contacts(scene, pioneer)) == touches
        assert _contacts(scene, dataclasses.replace(pioneer, body=None))


def test_slopes_are_no_contact(vehicle):
    ramp = scene_of([square()], poses=[pose(pitch_deg=-15.0)])
    scene = dataclasses.replace(ramp, paths=_scene().paths)
    assert _contacts(scene, vehicle) == ()
    assert _contacts(scene, vehicle, ground_m=0.0)  # through the slope


def test_contacts_are_in_order_and_parts_of_an_object_are_one(vehicle):
    scene = _scene(((1.5, 0.0, 0.3), (0.1, 0.1, 0.1)), ((0.5, 0.0, 0.3), (0.1, 0.1, 0.1)))
    found = _contacts(scene, vehicle)
    assert [contact.object for contact in found] == ["crate 1", "crate 0"]
    same = tuple(
        Instance("shelf", instance.mesh, instance.world_from_mesh)
        for instance in scene.instances[1:]
    )
    shelf = dataclasses.replace(scene, instances=(scene.instances[0], *same))
    (contact,) = _contacts(shelf, vehicle)
    assert contact.steps == sum(one.steps for one in found)
    assert str(contact) == (
        f"contact with shelf first at step {found[0].step}, {found[0].time_s:.2f} s, "
        f"({found[0].position_m[0]:.2f}, 0.00) m; {contact.steps} steps in all"
    )


def test_flying_poses_of_a_file(vehicle, tmp_path):
    """They keep their heights, and the box turns with them."""
    scene = _scene(((1.0, 0.0, 2.0), (0.1, 2.0, 0.1)))
    for roll_deg, z_m, touches in ((0.0, 2.2, False), (180.0, 2.2, True), (180.0, 2.9, False)):
        poses = np.array([pose((x, 0.0, z_m), roll_deg=roll_deg) for x in (0.0, 2.0)])
        write_trajectory(tmp_path / "fly.tum", Trajectory([0.0, 9.0], poses))
        route = Route(str(tmp_path / "fly.tum"), ignore_limits=True)
        assert bool(Drive(scene, vehicle, route).plan().contacts) == touches


@pytest.mark.parametrize(("name", "robot"), [("lap", "p2at"), ("lap_clockwise", "superscout")])
def test_the_paper_s_laps_touch_nothing(name, robot):
    assert Drive(load_scene("soccer"), Vehicle.load(robot), Route(name)).plan().contacts == ()


def test_robots_of_unknown_size_have_unknown_contacts(vehicle):
    scene = _scene(((0.5, 0.0, 0.5), (0.1, 0.1, 0.5)))
    body = dataclasses.replace(vehicle, footprint=None)
    np.testing.assert_allclose(BodyBoxes.of(body).high_m, (0.206, 0.206, 0.66), atol=2e-3)
    assert _contacts(scene, body)
    unknown = _contacts(scene, dataclasses.replace(body, body=None))
    assert unknown is None
    with pytest.raises(TrajectoryError, match=r"^way: the robot has neither a \[footprint\] nor a"):
        check_no_contact(unknown, "way")


def test_sweeps_hold_the_poses_and_fill_the_turns():
    poses = np.array([pose(), pose((1.0, 0.0, 0.0)), pose((1.0, 0.0, 0.0), yaw_deg=90.0)])
    trajectory = Trajectory([0.0, 1.0, 2.0], poses)
    sweep = Sweep.along(trajectory, reach_m=0.5)
    np.testing.assert_array_equal(sweep.world_from_base[sweep.is_step], poses)
    np.testing.assert_array_equal(sweep.times_s[sweep.is_step], trajectory.times_s)
    corners = sweep.world_from_base @ np.array((0.3, 0.4, 0.0, 1.0))
    assert np.linalg.norm(np.diff(corners, axis=0), axis=1).max() <= SPACING_M * (1 + 1e-9)
    assert len(Sweep.along(Trajectory([0.0], poses[:1]), 0.5).steps) == 1


@needs_warehouse
def test_shelves_of_a_real_scene(tmp_path):
    """A path through a shelf; the floor is the slab's top, 34 mm high."""
    (tmp_path / "way.csv").write_text("x_m,y_m\n-5,5\n-5,-5\n")
    drive = Drive(load_scene(WAREHOUSE), Vehicle.load("p2at"), Route(str(tmp_path / "way.csv")))
    plan = drive.plan()
    assert any("ShelfF" in contact.object for contact in plan.contacts)
    np.testing.assert_allclose(plan.truth.positions_m[:, 2], 0.0342, atol=2e-4)
    with pytest.raises(TrajectoryError, match=r"^way: contact with .*: expected none with --no-c"):
        check_no_contact(plan.contacts, "way")
