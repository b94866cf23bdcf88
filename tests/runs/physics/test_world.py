"""Physics of small worlds, against the equations of mechanics."""

import math

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="MuJoCo, an extra, is not installed")

from omnisim.core.poses import pose_from_rotation
from omnisim.runs.physics.convex_pieces import ConvexPiece, SolidShape
from omnisim.runs.physics.simulation import (
    FRICTION,
    PERIOD_S,
    STEP_S,
    SimulatedWorld,
    SolidObject,
    WorldModel,
)
from tests.runs.physics.worlds import ball, block, ground, rover

G = 9.80665
FAR = np.eye(4) + np.pad([[40.0], [40.0], [0.0]], ((0, 1), (3, 0)))  # the robot, out of the way


def _world(pieces, objects=None, robot=None, pose=FAR):
    found = robot or rover()
    model = WorldModel.of(pieces, objects or {}, {"cart": (found, pose)})
    return SimulatedWorld(model, {"cart": found}, {}, list(objects or {}))


def _run(world, seconds, rates=(0.0, 0.0)):
    """Bodies at the end of each period."""
    rows = []
    for _ in range(round(seconds / PERIOD_S)):
        world.advance(0.0, [rates])
        rows.append(world.bodies)
    return np.array(rows)


def _free_ball(position_m):
    mesh = ball((0.0, 0.0, 0.0)).shape.meshes[0]
    piece = ConvexPiece("ball", SolidShape.of(np.array(mesh.positions, dtype=float)))
    return {"ball": SolidObject([piece], pose_from_rotation(np.eye(3), position_m), 0.4)}


def _slope(angle_deg):
    """Rotation whose x points down a slope, sine and cosine, and a plane so inclined."""
    cos, sin = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    rotation = np.array([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]])
    plane = block((40.0, 4.0, 1.0), pose_from_rotation(rotation, rotation @ (0.0, 0.0, -0.5)))
    return rotation, sin, cos, plane


def test_free_fall_is_half_g_t_squared():
    world = _world([ground()], _free_ball((0.0, 0.0, 3.0)))
    heights = _run(world, 0.5)[:, 1, 2]
    times = PERIOD_S * np.arange(1, len(heights) + 1)
    # a semi-implicit Euler step is half a step ahead
    expected = 3.0 - 0.5 * G * times * (times + STEP_S)
    np.testing.assert_allclose(heights, expected, atol=1e-9)


@pytest.mark.parametrize("slope_deg", [20.0, 35.0])
def test_a_block_on_an_inclined_plane_sticks_or_slides_by_coulomb(slope_deg):
    rotation, sin, cos, plane = _slope(slope_deg)
    start = pose_from_rotation(rotation, rotation @ (-5.0, 0.0, 0.1))
    objects = {"block": SolidObject([block((0.4, 0.4, 0.2))], start, 2.0)}
    rows = _run(_world([plane], objects), 1.5)
    along = rows[:, 1, :3] @ rotation[:, 0]
    speed = np.diff(along) / PERIOD_S
    times = PERIOD_S * np.arange(1, len(rows))
    late = times > 0.5
    friction = FRICTION[0]
    acceleration = G * (sin - friction * cos)
    if acceleration < 0.0:
        assert abs(speed[late]).max() < 1e-3  # a creep
    else:
        found = np.polyfit(times[late], speed[late], 1)[0]
        assert found == pytest.approx(acceleration, rel=5e-3)


def test_a_robot_at_rest_stays_and_presses_into_the_ground_by_less_than_a_millimeter():
    world = _world([ground()], pose=np.eye(4))
    rows = _run(world, 2.0)[:, 0]
    assert np.abs(rows[-100:, :2]).max() < 1e-4
    assert -1e-3 < rows[-1, 2] < 0.0
    assert np.ptp(rows[-100:, 2]) < 1e-6


@pytest.mark.parametrize("drive", ["skid_steer", "differential"])
def test_straight_wheels_drive_as_far_as_they_turn(drive):
    robot = rover(drive)
    world = _world([ground()], robot=robot, pose=np.eye(4))
    rows = _run(world, 1.0, (1.0, 1.0))
    turned_rad = world.wheels_rad[0]
    rows = _run(world, 2.0, (1.0, 1.0))[:, 0]
    way_m = (world.wheels_rad[0] - turned_rad).mean() * robot.wheel_radius_m
    driven_m = rows[-1, 0] - rows[0, 0] + (rows[1, 0] - rows[0, 0])
    assert driven_m == pytest.approx(way_m, rel=2e-3)  # tires are pressed flat a little
    assert abs(rows[-1, 1]) < 1e-3


@pytest.mark.parametrize(
    ("drive", "rate"), [("skid_steer", 1.0), ("skid_steer", 4.0), ("differential", 4.0)]
)
def test_turns_on_the_spot_have_the_effective_track(drive, rate):
    """The balance of torques of tires that slide, against MuJoCo's contacts."""
    robot = rover(drive)
    world = _world([ground()], robot=robot, pose=np.eye(4))
    _run(world, 1.0, (-rate, rate))
    wheels, rows = world.wheels_rad[0], _run(world, 2.0, (-rate, rate))[:, 0]
    yaw = np.unwrap(2.0 * np.arctan2(rows[:, 6], rows[:, 3]), period=2.0 * math.pi)
    turned = (yaw[-1] - yaw[0]) * len(yaw) / (len(yaw) - 1)
    left_m, right_m = (world.wheels_rad[0] - wheels) * robot.wheel_radius_m
    assert (right_m - left_m) / robot.effective_track_m == pytest.approx(turned, rel=5e-3)
    expected = robot.track_m * (1.0 + (0.3 / 0.4) ** 2 if drive == "skid_steer" else 1.0)
    assert robot.effective_track_m == pytest.approx(expected)


def test_friction_bears_a_robot_up_a_slope_that_is_not_too_steep():
    rotation, _, _, plane = _slope(-15.0)  # up along x
    for friction, climbs in ((0.8, True), (0.1, False)):
        robot = rover(friction=friction)
        world = _world([plane], robot=robot, pose=pose_from_rotation(rotation, np.zeros(3)))
        along = _run(world, 2.0, (3.0, 3.0))[:, 0, :3] @ rotation[:, 0]
        assert along[-1] == pytest.approx(0.6, abs=0.03) if climbs else along[-1] < -0.5


def test_a_ball_that_rolls_keeps_rolling_and_slows_down():
    rotation, sin, cos, plane = _slope(10.0)
    world = _world([plane], _free_ball(rotation @ (-5.0, 0.0, 0.1)))
    along = _run(world, 1.0)[:, 1, :3] @ rotation[:, 0]
    speed = np.diff(along) / PERIOD_S
    acceleration = np.polyfit(PERIOD_S * np.arange(len(speed))[50:], speed[50:], 1)[0]
    # a solid ball: 5/7 of a block without friction, less the resistance of 0.02
    assert acceleration == pytest.approx(5.0 / 7.0 * G * (sin - 0.02 * cos), rel=0.02)
