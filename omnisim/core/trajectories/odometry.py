"""Wheel odometry: distances and turns, step by step.

Between two readings the robot is assumed to follow an arc, whose limits are a straight line and a
turn on the spot. Dead reckoning follows the same arcs exactly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike
from pydantic import AfterValidator, Field

from omnisim.core.arrays import Floats
from omnisim.core.errors import TrajectoryError
from omnisim.core.files.parameters import Number, Parameters
from omnisim.core.poses import MAX_M, wrap_angle, wrap_angles
from omnisim.core.short_repr import counted, short_repr
from omnisim.core.trajectories.formats.parsed_trajectory import (
    check_printed_times,
    checked_times,
    read_text_table,
)
from omnisim.core.trajectories.trajectory import Trajectory
from omnisim.core.trajectories.trajectory_files import write_lines

Scale = Annotated[Number, Field(gt=0.0, le=1000.0)]
Noise = Annotated[Number, Field(ge=0.0, le=1000.0)]
Angle = Annotated[Number, Field(ge=0.0, le=math.radians(1000.0))]


def _check_tick(tick: float) -> float:
    if 0.0 < tick < 1e-9:
        raise ValueError("expected 0, or at least 1e-09")
    return tick


@dataclass(frozen=True)
class OdometryErrors(Parameters, name="odometry", error=TrajectoryError):
    """Errors of the wheel odometry; none by default.

    The noise is a random walk: its variance grows with distance, so it does not depend on the
    number of steps. All values are assumptions of omnisim: nothing is published for the paper's
    robots.
    """

    distance_scale: Scale = 1.0
    """Reported meters per meter driven; above 1 for worn, smaller wheels."""
    turn_scale: Scale = 1.0
    """Reported radians per radian turned; above 1 if the wheels skid, by the error that calibration
    leaves."""
    drift_radpm: Annotated[Number, Field(ge=-math.radians(1000.0), le=math.radians(1000.0))] = 0.0
    """Reported turn in degrees per meter driven straight, caused by wheels of unequal size."""
    distance_noise_m_per_sqrt_m: Noise = 0.0
    """Standard deviation of the distance after 1 m, in meters."""
    turn_noise_rad_per_sqrt_m: Angle = 0.0
    """Standard deviation of the heading after 1 m, in degrees."""
    turn_noise_rad_per_sqrt_rad: Angle = 0.0
    """Standard deviation of the heading after a turn of 1 rad, in degrees."""
    distance_tick_m: Annotated[Noise, AfterValidator(_check_tick)] = 0.0
    """Resolution of the distance counter in meters; 0: unlimited."""
    turn_tick_rad: Annotated[Angle, AfterValidator(_check_tick)] = 0.0
    """Resolution of the turn counter in degrees; 0: unlimited."""


@dataclass(frozen=True, eq=False)
class Odometry:
    """Wheel readings, and the pose at the first reading.

    Raises:
        TrajectoryError: shapes do not match, or values are not finite.
    """

    times_s: Floats  # (n,) times of the readings
    distances_m: Floats  # (n − 1,) arc lengths between successive readings, negative backwards
    turns_rad: Floats  # (n − 1,) turns between successive readings; may exceed a full turn
    # x and y in meters and yaw in radians at the first reading
    start: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __repr__(self) -> str:
        distance_m = float(np.abs(self.distances_m).sum())
        return short_repr(self, counted(len(self.times_s), "reading"), f"{distance_m:.4g} m")

    def __post_init__(self) -> None:
        for name in ("times_s", "distances_m", "turns_rad"):
            values = np.array(getattr(self, name), dtype=np.float64)
            values.flags.writeable = False
            object.__setattr__(self, name, values)
        steps = (len(self.times_s) - 1,) if self.times_s.ndim == 1 else None
        if self.distances_m.shape != steps or self.turns_rad.shape != steps:
            raise TrajectoryError(
                f"odometry: times {self.times_s.shape}, distances {self.distances_m.shape}, "
                f"turns {self.turns_rad.shape}: expected (n,), (n − 1,) and (n − 1,)"
            )
        values = np.concatenate((self.times_s, self.distances_m, self.turns_rad, self.start))
        if not np.all(np.abs(values) < MAX_M) or len(self.start) != 3:
            raise TrajectoryError(
                "odometry: expected finite times, distances, turns and x, y, yaw of the start"
            )

    @property
    def planar_poses(self) -> Floats:
        """x, y in meters and yaw in radians (n, 3) by dead reckoning; yaw is not wrapped."""
        x, y, yaw = self.start
        yaws = yaw + np.concatenate(((0.0,), np.cumsum(self.turns_rad)))
        along = yaws[:-1] + 0.5 * self.turns_rad
        chords = self.distances_m * _chord_per_arc(self.turns_rad)
        steps = chords[:, None] * np.stack((np.cos(along), np.sin(along)), axis=-1)
        positions = np.concatenate((((0.0, 0.0),), np.cumsum(steps, axis=0))) + (x, y)
        return np.column_stack((positions, yaws))

    def dead_reckoned(self) -> Trajectory:
        """Trajectory by dead reckoning: level, at z = 0.

        Raises:
            TrajectoryError: times do not increase.
        """
        poses = self.planar_poses
        return Trajectory.on_ground(self.times_s, poses[:, :2], poses[:, 2])


def wheel_readings(truth: Trajectory) -> Odometry:
    """Readings of perfect wheels along a trajectory, of which only x, y and yaw are used.

    Each step is approximated by an arc; wheels do not measure sideways motion. Dead reckoning
    restores, up to rounding, a trajectory whose steps are arcs, lines and turns on the spot.
    """
    yaw = truth.yaw_rad
    turns = wrap_angles(np.diff(yaw))
    along = yaw[:-1] + 0.5 * turns
    moves = np.diff(truth.positions_m[:, :2], axis=0)
    chords = moves[:, 0] * np.cos(along) + moves[:, 1] * np.sin(along)
    start = (*truth.positions_m[0, :2].tolist(), float(yaw[0]))
    return Odometry(truth.times_s, chords / _chord_per_arc(turns), turns, start)


def simulate_odometry(truth: Trajectory, errors: OdometryErrors, seed: int) -> Odometry:
    """Simulate wheel readings along a trajectory.

    The noise is NumPy's PCG64, seeded by SeedSequence(seed), with two normal numbers per step, in
    order. A longer trajectory therefore begins with the readings of a shorter one. The numbers are
    scaled by +, −, ×, ÷ and a square root, which IEEE 754 rounds identically everywhere. Only the
    true steps pass through sine, cosine and arctangent, whose last bit may differ between machines.

    Args:
        truth: true trajectory; only x, y and yaw are used.
        errors: errors of the wheels.
        seed: 0 or above.

    Raises:
        TrajectoryError: the seed is negative.
    """
    return with_errors(wheel_readings(truth), errors, seed)


def with_errors(true: Odometry, errors: OdometryErrors, seed: int) -> Odometry:
    """Add wheel errors to error-free readings, as `simulate_odometry` does.

    Raises:
        TrajectoryError: the seed is negative.
    """
    distances, turns = WheelErrors(errors, seed).apply(true.distances_m, true.turns_rad)
    return Odometry(true.times_s, distances, turns, true.start)


class WheelErrors:
    """Errors of wheels; noise and counters continue from one call to the next.

    Raises:
        TrajectoryError: the seed is negative.
    """

    def __init__(self, errors: OdometryErrors, seed: int):
        if seed < 0:
            raise TrajectoryError(f"seed {seed}: expected 0 or above")
        self._errors, self._generator = errors, np.random.default_rng(seed)
        self._sums = [0.0, 0.0]  # reported distance and turn before rounding

    def apply(self, distances_m: Floats, turns_rad: Floats) -> tuple[Floats, Floats]:
        """Reported distances (n,) and turns (n,) of the next steps."""
        errors = self._errors
        normal = self._generator.standard_normal((len(distances_m), 2))
        driven, turned = np.abs(distances_m), np.abs(turns_rad)
        distance_sigma = errors.distance_noise_m_per_sqrt_m * np.sqrt(driven)
        turn_sigma = np.sqrt(
            errors.turn_noise_rad_per_sqrt_m * errors.turn_noise_rad_per_sqrt_m * driven
            + errors.turn_noise_rad_per_sqrt_rad * errors.turn_noise_rad_per_sqrt_rad * turned
        )
        reported = errors.distance_scale * distances_m + distance_sigma * normal[:, 0]
        turn = errors.turn_scale * turns_rad + errors.drift_radpm * distances_m
        turn += turn_sigma * normal[:, 1]
        return (
            self._counted(0, reported, errors.distance_tick_m),
            self._counted(1, turn, errors.turn_tick_rad),
        )

    def _counted(self, axis: int, increments: Floats, tick: float) -> Floats:
        """Quantize increments (n,) as a counter does: the sum is rounded, so no error grows."""
        if tick == 0.0 or not len(increments):
            return increments
        sums = np.cumsum(np.concatenate(((self._sums[axis],), increments)))
        self._sums[axis] = float(sums[-1])
        return np.diff(np.rint(sums / tick)) * tick


def _chord_per_arc(turns_rad: ArrayLike) -> Floats:
    """Chord lengths (n,) per meter of arc, for turns (n,): sin(turn / 2) / (turn / 2)."""
    return np.sinc(np.asarray(turns_rad) / (2.0 * math.pi))


# Odometry files: a CSV of readings, and of poses by dead reckoning.
#
# The columns are `t_s,distance_m,turn_rad,x_m,y_m,yaw_rad`. Distance and turn are counted from the
# previous line, and are 0 in the first. Numbers have nine digits after the point.

COLUMNS = ["t_s", "distance_m", "turn_rad", "x_m", "y_m", "yaw_rad"]
# A pose must follow from the previous one by the reading, up to the rounding of printed numbers.
AGREEMENT = 1e-8


def write_odometry(path: Path, odometry: Odometry) -> None:
    """Write readings and dead-reckoned poses atomically.

    Raises:
        TrajectoryError: times are equal when printed in nanoseconds.
        OutputError: the file cannot be written.
    """
    check_printed_times(odometry.times_s)
    readings = np.column_stack((odometry.distances_m, odometry.turns_rad))
    readings = np.concatenate((np.zeros((1, 2)), readings))
    rows = np.column_stack((odometry.times_s, readings, odometry.planar_poses))
    lines = (",".join(f"{value:.9f}" for value in row) for row in rows)
    write_lines(path, [",".join(COLUMNS), *lines])


def read_odometry(path: Path) -> Odometry:
    """Read a file written by `write_odometry`.

    Raises:
        TrajectoryError: the file is invalid, or its poses do not follow from its readings; names
            file, line, actual and expected value.
    """
    table = read_text_table(path)
    if table.lines[0].cells != COLUMNS:
        columns = ",".join(table.lines[0].cells)
        raise table.fault(table.lines[0], f"header {columns[:60]!r}: expected {','.join(COLUMNS)}")
    table = table.without_header()
    numbers = table.numbers(COLUMNS)
    times_s = checked_times(table, numbers[:, 0])
    far = np.any(np.abs(numbers) >= MAX_M, axis=1)
    if np.any(far):
        raise table.fault(table.lines[int(np.argmax(far))], f"expected numbers below {MAX_M:g}")
    readings, poses = numbers[:, 1:3], numbers[:, 3:]
    if np.any(readings[0] != 0.0):
        got = f"{readings[0, 0]:g} m, {readings[0, 1]:g} rad"
        raise table.fault(table.lines[0], f"first line: expected distance and turn 0, got {got}")
    for k in range(1, len(poses)):
        before = tuple(poses[k - 1])
        step = Odometry(times_s[k - 1 : k + 1], readings[k, :1], readings[k, 1:], before)
        off = poses[k] - step.planar_poses[1]
        off[2] = wrap_angle(off[2])
        if np.max(np.abs(off)) > AGREEMENT * (1.0 + np.max(np.abs((*poses[k], *readings[k])))):
            raise table.fault(
                table.lines[k],
                f"pose {math.hypot(off[0], off[1]):.3g} m and {abs(off[2]):.3g} rad off the pose "
                "that its reading gives: expected poses by dead reckoning along arcs",
            )
    return Odometry(times_s, readings[1:, 0], readings[1:, 1], tuple(poses[0].tolist()))
