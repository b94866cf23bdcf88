"""Motion of a robot on wheels that follows velocity commands, with its limits, on the floor.

Simulated time advances in ticks of 10 ms. At each tick the speed and the turn rate approach those
of the last command at the robot's accelerations, and both are linear in time within the tick. A
command ends after a timeout, as drivers of real bases stop when commands cease. The robot stays
level at the height of the floor, and stops in the tick in which its body would touch something.

A motion that ran along commands is the same, to the last bit, as one that is made from their file:
`omnisim drive` follows the commands that a served robot received.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from omnisim.core.arrays import Floats
from omnisim.core.errors import TrajectoryError
from omnisim.core.poses import MAX_M, pose_from_rotation, rotation_from_yaw
from omnisim.core.rate import printed_s
from omnisim.core.trajectories.body_motion import BodyMotion, MotionStates
from omnisim.core.trajectories.formats.parsed_trajectory import read_text_table
from omnisim.core.trajectories.trajectory import Trajectory
from omnisim.robots.kinematics import Kinematics
from omnisim.runs.ground import Ground

TICKS_PER_S = 100
TICK_S = 1.0 / TICKS_PER_S
TIMEOUT_S = 0.5  # of a command, as that of common base drivers
COLUMNS = ("t_s", "speed_mps", "turn_rate_radps", "x_m", "y_m", "yaw_rad")
MAX_DURATION_S = 24 * 3600.0
# Gauss–Legendre points and weights on [0, 1]: exact to 1e-15 m for a tick's arc
_POINTS = 0.5 + 0.5 * np.array((-math.sqrt(0.6), 0.0, math.sqrt(0.6)))
_WEIGHTS = np.array((5.0, 8.0, 5.0)) / 18.0


class WheelState(NamedTuple):
    """Place, speed and turn rate of a robot on wheels."""

    x_m: float
    y_m: float
    z_m: float
    yaw_rad: float
    speed_mps: float = 0.0
    turn_rate_radps: float = 0.0

    @property
    def pose(self) -> Floats:
        """Pose (4, 4) of the base, which is level."""
        rotation = rotation_from_yaw(np.array([self.yaw_rad]))
        return pose_from_rotation(rotation, np.array([self[:3]]))[0]


class VelocityCommand(NamedTuple):
    """Speed and turn rate that are asked for from a time on."""

    time_s: float
    speed_mps: float
    turn_rate_radps: float


def next_state(
    state: WheelState,
    asked: tuple[float, float],
    limits: Kinematics,
    ground: Ground,
    seconds: float,
) -> tuple[WheelState, str]:
    """State after a time, for a speed and turn rate asked, and the instance that stopped it.

    Limits clamp speeds and accelerations; what stops the robot is named, or empty.
    """
    rates = []
    for value, now, most, change in (
        (asked[0], state.speed_mps, limits.max_speed_mps, limits.max_acceleration_mps2),
        (
            asked[1],
            state.turn_rate_radps,
            limits.max_turn_rate_radps,
            limits.max_turn_acceleration_radps2,
        ),
    ):
        clamped = min(max(value, -most), most)
        rates.append(now + min(max(clamped - now, -change * seconds), change * seconds))
    if not any((*rates, state.speed_mps, state.turn_rate_radps)):
        return state, ""
    moving = WheelState(*state[:4], *rates)
    x, y, yaw = _moved(np.array([state]), np.array([moving]), np.ones(1), seconds)[0].tolist()
    z = ground.height_m((x, y), state.z_m)
    reached = WheelState(x, y, z, yaw, *rates)
    blocked_by = ground.contact(state.pose, reached.pose)
    return (WheelState(*state[:4]), blocked_by) if blocked_by else (reached, "")


def _moved(before: Floats, after: Floats, shares: Floats, tick_s: float) -> Floats:
    """x, y and yaw (n, 3) at shares (n,) of ticks between states (n, 6)."""
    seconds = shares[:, None] * _POINTS * tick_s  # (n, 3)
    speed, rate = (before[:, k, None] for k in (4, 5))
    changes = (after[:, 4:] - before[:, 4:]) / tick_s
    yaw = before[:, 3, None] + rate * seconds + 0.5 * changes[:, 1, None] * seconds**2
    speeds = (speed + changes[:, 0, None] * seconds) * _WEIGHTS * (shares[:, None] * tick_s)
    whole_s = shares * tick_s
    return np.column_stack(
        (
            before[:, 0] + (speeds * np.cos(yaw)).sum(axis=1),
            before[:, 1] + (speeds * np.sin(yaw)).sum(axis=1),
            before[:, 3] + before[:, 5] * whole_s + 0.5 * changes[:, 1] * whole_s**2,
        )
    )


class CommandedMotion(BodyMotion):
    """Motion along velocity commands, from rest at time 0; it grows with `advance`.

    Args:
        start: state at time 0.
        limits: limits of the robot.
        ground: floor, and what stops the robot.
        timeout_s: duration of a command.
        kept_s: duration of the past that is kept; infinite: all of it.
        heard: called with each command and the state at its time, also with the rest that follows
            a command whose time has run out.
    """

    def __init__(
        self,
        start: WheelState,
        limits: Kinematics,
        ground: Ground,
        timeout_s: float = TIMEOUT_S,
        kept_s: float = math.inf,
        heard: Callable[[VelocityCommand, WheelState], None] | None = None,
    ):
        self._heard = heard
        self.start_s = self.end_s = 0.0
        self.blocked_by = ""  # instance that stops the robot; empty: none
        self._limits, self._ground, self._timeout_s = limits, ground, timeout_s
        self._command = VelocityCommand(-math.inf, 0.0, 0.0)
        self._first = 0  # number of the first tick that is kept
        self._kept = kept_s * TICKS_PER_S + 1.0  # ticks
        self._states_at = [start]  # at each tick

    @property
    def state(self) -> WheelState:
        """State at the end."""
        return self._states_at[-1]

    def command(self, speed_mps: float, turn_rate_radps: float) -> VelocityCommand:
        """Ask for a speed and a turn rate from the end of the motion on."""
        self._command = VelocityCommand(self.end_s, speed_mps, turn_rate_radps)
        if self._heard is not None:
            self._heard(self._command, self.state)
        return self._command

    def place(self, state: WheelState) -> None:
        """Put the robot at another place, at rest, without a command."""
        self._states_at[-1] = state
        self._command = VelocityCommand(-math.inf, 0.0, 0.0)

    def advance(self, to_s: float) -> None:
        """Advance in ticks until the motion reaches a time."""
        while self.end_s < to_s:
            is_old = self.end_s - self._command.time_s >= self._timeout_s - 0.5 * TICK_S
            if is_old and any(self._command[1:]):
                self.command(0.0, 0.0)
            state, self.blocked_by = next_state(
                self.state, self._command[1:], self._limits, self._ground, TICK_S
            )
            self._states_at.append(state)
            self.end_s = (self._first + len(self._states_at) - 1) / TICKS_PER_S
            if len(self._states_at) > 2.0 * self._kept:
                dropped = len(self._states_at) - math.ceil(self._kept)
                del self._states_at[:dropped]
                self._first += dropped

    def _states(self, times_s: Floats) -> MotionStates:
        ticks = np.clip(
            np.floor(times_s * TICKS_PER_S + 1e-6).astype(np.int64) - self._first,
            0,
            max(0, len(self._states_at) - 2),
        )
        pairs = [
            (self._states_at[tick], self._states_at[min(tick + 1, len(self._states_at) - 1)])
            for tick in ticks.tolist()
        ]
        both = np.array(pairs).reshape(-1, 2, 6)
        before, after = both[:, 0], both[:, 1]
        shares = np.clip(times_s * TICKS_PER_S - (ticks + self._first), 0.0, 1.0)
        moved = _moved(before, after, shares, TICK_S)
        climbs_mps = (after[:, 2] - before[:, 2]) / TICK_S
        heights_m = before[:, 2] + climbs_mps * shares * TICK_S
        changes = (after[:, 4:] - before[:, 4:]) / TICK_S
        speeds, rates = (before[:, 4:] + changes * (shares * TICK_S)[:, None]).T
        cosine, sine, still = np.cos(moved[:, 2]), np.sin(moved[:, 2]), np.zeros(len(times_s))
        ahead, left = np.stack((cosine, sine, still), 1), np.stack((-sine, cosine, still), 1)
        up = np.array((0.0, 0.0, 1.0))
        positions = np.column_stack((moved[:, :2], heights_m))
        return MotionStates(
            pose_from_rotation(rotation_from_yaw(moved[:, 2]), positions),
            ahead * speeds[:, None] + up * climbs_mps[:, None],
            ahead * changes[:, :1] + left * (speeds * rates)[:, None],
            up * rates[:, None],
        )


@dataclass(frozen=True, eq=False)
class CommandsFile:
    """Commands that a robot received, and where it began."""

    start: tuple[float, float, float]  # x and y in meters and yaw in radians at time 0
    commands: tuple[VelocityCommand, ...]  # in the order of their times
    end_s: float  # end of the motion: the time of the last line

    @classmethod
    def read(cls, path: Path) -> CommandsFile | None:
        """Read a CSV of commands with exactly the columns `COLUMNS`; None: another file.

        Columns x_m, y_m and yaw_rad say where the robot was; those of the first line are the start.

        Raises:
            TrajectoryError: the file is invalid; names file, line, actual and expected value.
        """
        table = read_text_table(path)
        if table.lines[0].cells != list(COLUMNS):
            return None
        table = table.without_header()
        numbers = table.numbers(list(COLUMNS))
        ticks = numbers[:, 0] * TICKS_PER_S
        for line, row, tick in zip(table.lines, numbers, ticks.tolist(), strict=True):
            if not 0.0 <= row[0] <= MAX_DURATION_S or abs(tick - round(tick)) > 1e-4:
                expected = f"expected multiples of {TICK_S:g} s up to {MAX_DURATION_S:g}"
                raise table.fault(line, f"t_s = {line.cells[0]}: {expected}")
            if np.any(np.abs(row) > MAX_M):
                raise table.fault(line, f"expected numbers below {MAX_M:g}")
        if ticks[0] > 1e-4 or np.any(np.diff(ticks) < -1e-4):
            expected = "expected times from 0 that do not decrease"
            raise TrajectoryError(f"{path}: {expected}")
        if not ticks[-1] > 0.5:
            raise TrajectoryError(f"{path}: expected a last line after 0 s, which ends the motion")
        commands = (VelocityCommand(*row[:3]) for row in numbers.tolist())
        x_m, y_m, yaw_rad = numbers[0, 3:].tolist()
        return cls((x_m, y_m, yaw_rad), tuple(commands), round(float(ticks[-1])) / TICKS_PER_S)

    def motion(self, limits: Kinematics, ground: Ground, start_height_m: float) -> CommandedMotion:
        """Motion along the commands, each until the next, to the end."""
        x, y, yaw = self.start
        start = WheelState(x, y, ground.height_m((x, y), start_height_m), yaw)
        motion = CommandedMotion(start, limits, ground, timeout_s=math.inf)
        for command in self.commands:
            motion.advance(round(command.time_s * TICKS_PER_S) / TICKS_PER_S)
            motion.command(*command[1:])
        motion.advance(self.end_s)
        return motion


def command_line(command: VelocityCommand, state: WheelState) -> str:
    """Line of a commands file; its numbers repeat exactly."""
    numbers = (*command, state.x_m, state.y_m, state.yaw_rad)
    return ",".join(repr(float(number)) for number in numbers)


def sampled(motion: BodyMotion, rate_hz: float) -> Trajectory:
    """Trajectory of a motion from time 0, at a rate."""
    times_s = printed_s(np.arange(math.floor(motion.end_s * rate_hz + 1e-6) + 1) / rate_hz)
    return Trajectory(times_s, motion.at(times_s).world_from_base)


def lines_of(motion: CommandedMotion, commands: list[str]) -> Iterator[str]:
    """Lines of a commands file: the header, the commands, and the end."""
    yield ",".join(COLUMNS)
    yield from commands
    yield command_line(VelocityCommand(motion.end_s, 0.0, 0.0), motion.state)
