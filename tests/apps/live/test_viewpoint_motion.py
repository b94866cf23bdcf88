"""Motion by hand: within the robot's limits, and never through a wall."""

import math

import numpy as np
import pytest

from omnisim.apps.live.live_source import RADIUS_M, circle
from omnisim.apps.live.viewpoint_motion import (
    EYE_M,
    FreeFlight,
    MotionCommand,
    Place,
    ViewpointDrive,
)
from omnisim.robots.kinematics import Kinematics
from omnisim.robots.vehicle import BodyBoxes
from omnisim.runs.ground import Ground
from omnisim.scene import Scene

LIMITS = Kinematics("differential", 1.0, 2.0, 0.5, 4.0)
STEP_S = 0.05
BOX = BodyBoxes(
    np.array((-0.2, -0.2, 0.0)), np.array((0.2, 0.2, 0.5)), 0.03,
    np.array([[[-0.2, -0.2, 0.03], [0.2, 0.2, 0.5]]]),
)  # fmt: skip


def _floor():
    corners = [[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]]
    return Scene.from_arrays("floor", corners, [[0, 1, 2], [0, 2, 3]])


def _room():
    """Floor with a wall across x = 2, and a step of 2 cm at x = −1."""
    wall = Scene.from_arrays("wall", [[2, -9, 0], [2, 9, 0], [2, 0, 3]], [[0, 1, 2]])
    step = Scene.from_arrays(
        "step", [[-9, -9, 0.02], [-1, -9, 0.02], [-1, 9, 0.02], [-9, 9, 0.02]],
        [[0, 1, 2], [0, 2, 3]],
    )  # fmt: skip
    return _floor().added("wall", wall).added("step", step)


def _move(pilot, command, steps, step_s=STEP_S):
    """Places of a pilot, from the first."""
    pilot.command = command
    places = [pilot.place]
    for _ in range(steps):
        pilot.advance(step_s)
        places.append(pilot.place)
    return places


@pytest.fixture
def robot():
    return ViewpointDrive(Place((0.0, 0.0, 0.0)), LIMITS, Ground(_room(), BOX))


def test_a_robot_keeps_its_limits(robot):
    poses = _move(robot, MotionCommand(ahead=-1.0, turn=1.0), 100)
    positions = np.array([place.position_m[:2] for place in poses])
    speeds = np.linalg.norm(np.diff(positions, axis=0), axis=1) / STEP_S
    yaw = np.unwrap(np.radians([place.yaw_deg for place in poses]))
    slack = 2e-4 / STEP_S  # places are rounded to 0.1 mm
    assert speeds.max() <= LIMITS.max_speed_mps + slack
    assert np.abs(np.diff(speeds)).max() / STEP_S <= LIMITS.max_acceleration_mps2 + slack / STEP_S
    assert np.abs(np.diff(yaw)).max() / STEP_S <= LIMITS.max_turn_rate_radps + 1e-3
    assert speeds[-1] == pytest.approx(LIMITS.max_speed_mps, abs=slack)


def test_a_robot_stops_at_a_wall_and_names_it(robot):
    _move(robot, MotionCommand(ahead=1.0), 200)
    assert robot.blocked_by == "wall"
    assert 1.6 < robot.place.position_m[0] <= 1.8
    _move(robot, MotionCommand(ahead=-1.0), 20)
    assert robot.place.position_m[0] < 1.75


def test_a_robot_climbs_a_step_within_its_clearance(robot):
    _move(robot, MotionCommand(ahead=-1.0), 80)
    assert robot.place.position_m[0] < -1.2
    assert robot.place.position_m[2] == 0.02


@pytest.mark.parametrize("goal", [(1.0, 1.0), (-1.5, 0.4), (0.0, -2.0)])
def test_a_robot_goes_to_a_clicked_point_and_rests(robot, goal):
    robot.goal_m = goal
    for _ in range(400):
        robot.advance(STEP_S)
        if not robot.is_moving:
            break
    assert math.dist(robot.place.position_m[:2], goal) < 0.05
    assert not robot.is_moving


def test_free_flight_goes_where_it_looks():
    flight = FreeFlight(Place((0.0, 0.0, 1.0), 90.0))
    _move(flight, MotionCommand(ahead=1.0, left=0.25, up=0.5), 40)
    x, y, z = flight.place.position_m
    assert x == pytest.approx(-0.25 * y, abs=2e-3)  # to the left of +y
    assert 1.5 < y < 2.0
    assert z > 1.5
    _move(flight, MotionCommand(), 40)
    assert not flight.is_moving


def test_free_flight_does_not_tip_over():
    flight = FreeFlight(Place((0.0, 0.0, 1.0)))
    _move(flight, MotionCommand(tilt=1.0), 100, 0.2)
    assert flight.place.pitch_deg == 89.0
    flight.turn(10.0, 500.0)
    assert flight.place.pitch_deg == 89.0
    assert flight.place.yaw_deg == 10.0


def _fly(flight, command, steps=60, step_s=STEP_S):
    return np.array([place.position_m for place in _move(flight, command, steps, step_s)])


@pytest.mark.parametrize("step_s", [STEP_S, 0.2])
def test_a_wall_stops_free_flight_and_is_named(step_s):
    flight = FreeFlight(Place((0.0, 0.0, 1.0)), Ground(_room()))
    places = _fly(flight, MotionCommand(ahead=1.0, fast=4.0), step_s=step_s)
    assert places[-1, 0] == pytest.approx(2.0 - EYE_M, abs=1e-3)
    assert flight.blocked_by == "wall"
    _fly(flight, MotionCommand(ahead=-1.0), 20)
    assert flight.place.position_m[0] < 1.7
    assert flight.blocked_by == ""


def test_free_flight_slides_along_a_wall_and_down_to_the_floor():
    flight = FreeFlight(Place((1.5, 0.0, 1.0), 60.0), Ground(_room()))
    places = _fly(flight, MotionCommand(ahead=1.0, up=-1.0, fast=3.0), 40)
    assert np.abs(places[-1, [0, 2]] - (2.0 - EYE_M, EYE_M)).max() < 1e-3
    assert places[-1, 1] > 2.0
    assert places[:, 0].max() < 2.0 - 0.99 * EYE_M


def test_a_viewpoint_near_the_floor_keeps_its_own_distance():
    flight = FreeFlight(Place((0.0, 0.0, 0.03), 90.0), Ground(_floor()))
    places = _fly(flight, MotionCommand(ahead=1.0, up=-0.5), 40)
    assert np.abs(places[:, 2] - 0.03).max() < 1e-3
    assert places[-1, 1] > 1.5


def test_without_walls_free_flight_passes():
    flight = FreeFlight(Place((0.0, 0.0, 1.0)), Ground(_room()))
    flight.has_walls = False
    assert _fly(flight, MotionCommand(ahead=1.0, fast=4.0), 40)[-1, 0] > 3.0


def test_a_goal_behind_a_wall_ends_at_the_wall():
    flight = FreeFlight(Place((0.0, 0.0, 1.0)), Ground(_room()))
    flight.goal_m = (4.0, 0.0)
    _fly(flight, MotionCommand(), 100)
    assert not flight.is_moving
    assert flight.place.position_m[0] == pytest.approx(2.0 - EYE_M, abs=1e-3)


def test_a_pause_is_no_jump():
    flight = FreeFlight(Place((0.0, 0.0, 1.0)))
    flight.command = MotionCommand(ahead=1.0)
    flight.advance(3600.0)
    assert flight.place.position_m[0] < 0.3


def test_a_film_goes_once_around_a_circle_looking_ahead():
    start = Place((1.0, -2.0, 0.5), 30.0)
    places = list(circle(start, 36))
    assert places[0] == start
    positions_m = np.array([place.position_m for place in places])
    center_m = start.position_m + RADIUS_M * np.array([-0.5, np.sqrt(0.75), 0.0])  # to its left
    distances_m = np.linalg.norm(positions_m - center_m, axis=1)
    np.testing.assert_allclose(distances_m, RADIUS_M, atol=1e-4)
    ways = np.diff(positions_m, axis=0, append=positions_m[:1])
    headings = np.radians([place.yaw_deg + 5.0 for place in places])  # half a step on
    ahead = np.stack((np.cos(headings), np.sin(headings), 0.0 * headings), axis=1)
    np.testing.assert_allclose(ways, ahead * (2.0 * RADIUS_M * np.sin(np.radians(5.0))), atol=2e-4)
