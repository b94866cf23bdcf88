"""Motion by velocity commands: limits, timeouts, walls, and the same motion from its file."""

import math

import numpy as np
import pytest
import scipy

from omnisim.core.errors import TrajectoryError
from omnisim.robots.kinematics import Kinematics
from omnisim.robots.vehicle import BodyBoxes, Vehicle
from omnisim.runs.commanded_motion import (
    CommandedMotion,
    CommandsFile,
    VelocityCommand,
    WheelState,
    command_line,
    lines_of,
)
from omnisim.runs.ground import Ground
from omnisim.runs.route import Route, plan_route
from omnisim.scene import Scene, read_scene

LIMITS = Kinematics("differential", 1.0, 2.0, 0.5, 4.0)
BOX = BodyBoxes(
    np.array((-0.2, -0.2, 0.0)), np.array((0.2, 0.2, 0.5)), 0.03,
    np.array([[[-0.2, -0.2, 0.03], [0.2, 0.2, 0.5]]]),
)  # fmt: skip


@pytest.fixture(scope="module")
def ground():
    floor = Scene.from_arrays(
        "floor", [[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]], [[0, 1, 2], [0, 2, 3]]
    )
    wall = Scene.from_arrays("wall", [[2, -9, 0], [2, 9, 0], [2, 0, 3]], [[0, 1, 2]])
    return Ground(floor.added("wall", wall), BOX)


def _driven(ground, *commands, end_s, kept_s=math.inf):
    motion = CommandedMotion(WheelState(0.0, 0.0, 0.0, 0.0), LIMITS, ground, kept_s=kept_s)
    for time_s, speed_mps, turn_rate_radps in commands:
        motion.advance(time_s)
        motion.command(speed_mps, turn_rate_radps)
    motion.advance(end_s)
    return motion


def test_speed_follows_the_limits_and_ends_after_the_timeout(ground):
    motion = _driven(ground, (0.0, 9.0, 0.0), (0.4, 9.0, 0.0), end_s=3.0)
    states = motion.at(np.array([0.2, 0.9, 1.2, 2.9]))
    # 0.5 m/s² until 0.4 s + the timeout, then braking as fast
    assert states.velocity_mps[:, 0] == pytest.approx([0.1, 0.45, 0.3, 0.0], abs=1e-12)
    assert states.world_from_base[-1, 0, 3] == pytest.approx(0.45**2 / 0.5, abs=1e-12)


def test_pose_is_the_integral_of_its_rates(ground):
    motion = _driven(ground, (0.0, 0.8, 1.5), (0.37, -0.3, -2.0), (0.7, 0.6, 0.4), end_s=1.2)
    times_s = np.linspace(0.0, 1.2, 48001)
    states = motion.at(times_s)
    for values, rates in (
        (states.world_from_base[:, :3, 3], states.velocity_mps),
        (states.velocity_mps, states.acceleration_mps2),
    ):
        moved = scipy.integrate.cumulative_trapezoid(rates, times_s, axis=0, initial=0.0)
        # 25 µs steps: accelerations jump at ticks, half a step of at most 5 m/s²
        assert values == pytest.approx(values[0] + moved, abs=2e-4)
    yaw = np.unwrap(np.arctan2(states.world_from_base[:, 1, 0], states.world_from_base[:, 0, 0]))
    turned = scipy.integrate.cumulative_trapezoid(
        states.angular_rate_radps[:, 2], times_s, initial=0.0
    )
    assert yaw == pytest.approx(turned, abs=1e-9)


def test_a_wall_stops_the_robot_and_lets_it_back(ground):
    commands = [(0.1 * k, 1.0, 0.0) for k in range(60)]
    motion = _driven(ground, *commands, end_s=6.0)
    assert motion.blocked_by == "wall"
    assert 1.79 < motion.state.x_m <= 1.8
    motion.command(-1.0, 0.0)
    motion.advance(6.5)
    assert motion.blocked_by == ""
    assert motion.state.x_m < 1.76


def test_forgetting_the_past_changes_nothing_else(ground):
    commands = [(0.2 * k, 0.5, 0.3 * (-1) ** k) for k in range(50)]
    whole, short = (_driven(ground, *commands, end_s=10.0, kept_s=kept) for kept in (math.inf, 1.0))
    times_s = np.linspace(9.1, 10.0, 37)
    np.testing.assert_array_equal(
        whole.at(times_s).world_from_base, short.at(times_s).world_from_base
    )
    assert len(short._states_at) < 205


@pytest.mark.parametrize("timeout_s", [0.05, 0.5, 3.0])
def test_a_motion_repeats_from_its_file_to_the_bit(tmp_path, ground, timeout_s):
    """Commands that ran out are in the file, whatever their timeout was."""
    file = tmp_path / "commands.csv"
    start, lines = WheelState(0.3, -0.1, 0.0, 0.7), []
    motion = CommandedMotion(
        start, LIMITS, ground, timeout_s, heard=lambda *heard: lines.append(command_line(*heard))
    )
    for k in range(7):
        motion.advance(0.13 * k)
        motion.command(0.3 + 0.1 * k, math.sin(k))
    motion.advance(2.0)
    file.write_text("\n".join(lines_of(motion, lines)))
    repeated = CommandsFile.read(file).motion(LIMITS, ground, 0.0)
    times_s = np.linspace(0.0, 2.0, 77)
    for one, other in zip(motion.at(times_s), repeated.at(times_s), strict=True):
        np.testing.assert_array_equal(one, other)
    assert repeated.end_s == motion.end_s


def test_a_robot_drives_by_a_file_of_commands(tmp_path):
    file = tmp_path / "commands.csv"
    rows = ["0,0.5,0,-1,0,0", "0.3,0.5,0.5,0,0,0", "0.8,0,0,0,0,0"]
    file.write_text("t_s,speed_mps,turn_rate_radps,x_m,y_m,yaw_rad\n" + "\n".join(rows))
    route = plan_route(read_scene("soccer"), Vehicle.load("p2at"), Route(str(file), rate_hz=5.0))
    assert len(route.trajectory) == 5
    assert route.trajectory.positions_m[0] == pytest.approx((-1.0, 0.0, 0.0))
    assert route.trajectory.yaw_rad[-1] > 0.1
    assert route.motion.end_s == 0.8


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ("0,1,0,0,0,0", "last line after 0 s"),
        ("0,1,0,0,0,0\n0.005,1,0,0,0,0", "t_s = 0.005: expected multiples of 0.01 s"),
        ("0.5,1,0,0,0,0\n1,1,0,0,0,0", "times from 0"),
        ("0,1,0,0,0,0\n1e9,1,0,0,0,0", "t_s = 1e9: expected multiples"),
        ("0,1,0,0,0\n", "5 columns: expected 6"),
        ("0,1,nan,0,0,0\n", "expected a finite number"),
    ],
)
def test_invalid_commands_name_the_line(tmp_path, rows, message):
    file = tmp_path / "commands.csv"
    file.write_text(f"t_s,speed_mps,turn_rate_radps,x_m,y_m,yaw_rad\n{rows}\n")
    with pytest.raises(TrajectoryError, match=message) as fault:
        CommandsFile.read(file)
    assert str(file) in str(fault.value)


def test_a_command_repeats_in_print():
    command = VelocityCommand(0.07, 0.1 + 0.2, 1 / 3)
    line = command_line(command, WheelState(0.0, 0.0, 0.0, 0.0))
    assert tuple(map(float, line.split(",")[:3])) == command
