"""Kinematic limits of a robot, and checks of trajectories against them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from omnisim.core.arrays import Floats
from omnisim.core.errors import TrajectoryError
from omnisim.core.files.parameters import Number, Parameters
from omnisim.core.poses import rotation_angles
from omnisim.core.trajectories.trajectory import Trajectory, step_lengths_m

DriveType = Literal["differential", "skid_steer"]
Limit = Annotated[Number, Field(ge=1e-4, le=1e6)]
AngularLimit = Annotated[Number, Field(ge=math.radians(1e-4), le=math.radians(1e6))]
# Relative to the limits: a trajectory at its limits exceeds them by rounding.
TOLERANCE = 1e-6
# Per step, in meters or radians: files hold nine digits of positions, times and quaternions.
PRINTED = 5e-9
# Motion that wheels cannot produce but recordings contain: noise, skids, slopes with level poses.
SLACK_M = 0.1  # in total: pose noise, which does not accumulate
SIDE_SLIP = math.tan(math.radians(5.0))  # per meter ahead: skidding, heading errors
GRADE = 0.45  # per meter ahead: the steepest slope of a Pioneer 2 AT
TURN_ARM_M = 0.1  # skidding wheels turn about a point ahead of or behind the base's origin


@dataclass(frozen=True)
class Kinematics(Parameters, name="kinematics", error=TrajectoryError):
    """Limits of a robot that drives straight, in arcs or turns on the spot, but never sideways."""

    synonyms: ClassVar[Mapping[str, str]] = {
        "max_turn_rate_dps": "max_turn_rate_degps",
        "max_turn_acceleration_dps2": "max_turn_acceleration_degps2",
    }

    drive: DriveType
    """Type of drive: "differential", with two wheels and a caster, or "skid_steer", whose wheels
    skid in turns. The motion is the same; the wheel odometry differs, see odometry.turn_scale."""
    max_speed_mps: Limit
    """Maximum speed in m/s, forwards and backwards."""
    max_turn_rate_radps: AngularLimit
    """Maximum turn rate in °/s, to either side."""
    max_acceleration_mps2: Limit
    """Maximum acceleration in m/s², for braking as well."""
    max_turn_acceleration_radps2: AngularLimit
    """Maximum turn acceleration in °/s², for starting and stopping a turn."""

    @classmethod
    def file_key(cls, name: str) -> str:
        """Key of a field in files; that of the drive is `type`, as in every table of kinds."""
        return "type" if name == "drive" else super().file_key(name)


@dataclass(frozen=True, eq=False)
class Steps:
    """Steps between successive poses."""

    distances_m: Floats  # (n,) straight-line distances, negative for reverse motion
    turns_rad: Floats  # (n,) turn angles in [−π, π]


def steps_between(world_from_base: Floats) -> Steps:
    """Compute the n − 1 steps between poses (n, 4, 4)."""
    moves = np.diff(world_from_base[:, :3, 3], axis=0)
    ahead = world_from_base[:-1, :3, 0] + world_from_base[1:, :3, 0]
    backwards = np.sum(moves * ahead, axis=1) < 0.0
    lengths = step_lengths_m(world_from_base)
    rotations = world_from_base[:, :3, :3]
    turns = rotation_angles(rotations[:-1], rotations[1:])
    return Steps(np.where(backwards, -lengths, lengths), turns)


@dataclass(frozen=True)
class LimitViolation:
    """Step of a trajectory that exceeds a limit of the robot."""

    quantity: str  # name of the limited quantity, such as "turn rate"
    unit: str  # unit of `value` and `limit`
    step: int  # index k of the step from pose k to pose k + 1
    time_s: float  # time of pose k
    # value, limit: the trajectory's value and the limit, in `unit`
    value: float
    limit: float

    def __str__(self) -> str:
        return (
            f"step {self.step} → {self.step + 1} at {self.time_s:g} s: {self.quantity} "
            f"{self.value:g} {self.unit}: expected at most {self.limit:g} {self.unit}"
        )


def find_violation(trajectory: Trajectory, kinematics: Kinematics) -> LimitViolation | None:
    """Find the first step beyond a limit of speed, turn rate or acceleration, or None.

    Speeds are means over a step. Accelerations are the changes between the means of successive
    steps. Both are lower bounds: any motion through the poses reaches at least these values.
    """
    steps = steps_between(trajectory.world_from_base)
    durations = np.diff(trajectory.times_s)
    checks = []
    for values, speed, acceleration in (
        (
            steps.distances_m,
            ("speed", "m/s", kinematics.max_speed_mps),
            ("acceleration", "m/s²", kinematics.max_acceleration_mps2),
        ),
        (
            steps.turns_rad,
            ("turn rate", "rad/s", kinematics.max_turn_rate_radps),
            ("turn acceleration", "rad/s²", kinematics.max_turn_acceleration_radps2),
        ),
    ):
        checks.append((*speed, _first(np.abs(values), speed[2], durations, 0, PRINTED)))
        # Rates k and k + 1 differ by more than the acceleration allows between the middles of their
        # steps. There is no division, as a step may be as short as the smallest float64.
        if len(values) > 1:
            before, after = durations[:-1], durations[1:]
            change = np.abs(values[1:] * before - values[:-1] * after)
            scale = 0.5 * (before + after) * before * after
            slack = PRINTED * (before + after)
            checks.append((*acceleration, _first(change, acceleration[2], scale, 1, slack)))
    over = [(hit[0], hit[1], name, unit, limit) for name, unit, limit, hit in checks if hit]
    if not over:
        return None
    step, value, name, unit, limit = min(over, key=lambda item: item[0])
    return LimitViolation(name, unit, step, float(trajectory.times_s[step]), value, limit)


def find_drift(trajectory: Trajectory) -> LimitViolation | None:
    """Find the first step whose sideways or vertical motion exceeds what wheels allow, or None.

    The sum counts the motion, in the robot's own frame, that slip, slopes and turns within a step
    do not explain. Noise of recorded poses averages out; a slide in small steps adds up.

    Source: cumulative sums with an allowance, Page 1954, "Continuous inspection schemes".
    """
    poses = trajectory.world_from_base
    moves_m = np.diff(poses[:, :3, 3], axis=0)
    axes = 0.5 * (poses[:-1, :3, :3] + poses[1:, :3, :3])
    ahead_m, left_m, up_m = np.einsum("ni,nij->jn", moves_m, axes)
    # a robot that turns first and then drives leaves the mean heading by half the turn
    steps = steps_between(poses)
    turning_m = (0.5 * np.abs(steps.distances_m) + TURN_ARM_M) * np.abs(steps.turns_rad)
    violations = []
    for name, sums_m in (
        ("sideways motion", _exceeded(left_m, SIDE_SLIP * np.abs(ahead_m) + turning_m)),
        ("vertical motion", _exceeded(up_m, GRADE * np.abs(ahead_m) + turning_m)),
    ):
        if hit := _first(sums_m, SLACK_M, np.ones(len(sums_m)), 0):
            time_s = float(trajectory.times_s[hit[0]])
            violations.append(LimitViolation(name, "m", hit[0], time_s, hit[1], SLACK_M))
    return min(violations, key=lambda violation: violation.step, default=None)


def check_drivable(
    trajectory: Trajectory, kinematics: Kinematics, source: str, lines: ArrayLike | None = None
) -> None:
    """Raise an error if a trajectory exceeds the limits.

    The message names the trajectory's `source`, and the line of the pose if `lines` (n,) are given.

    Raises:
        TrajectoryError: a limit is exceeded; names the first violation, its value and the limit.
    """
    checks = (find_violation(trajectory, kinematics), find_drift(trajectory))
    violations = [violation for violation in checks if violation is not None]
    if violations:
        violation = min(violations, key=lambda violation: violation.step)
        line = "" if lines is None else f":{np.asarray(lines)[violation.step + 1]}"
        raise TrajectoryError(f"{source}{line}: {violation}")


def _exceeded(moves_m: Floats, allowed_m: Floats) -> Floats:
    """Larger one-sided cumulative sum (n,) of moves (n,) in excess of the allowed ones."""
    sums = np.zeros((2, len(moves_m) + 1))
    for k, (move_m, slack_m) in enumerate(zip(moves_m, allowed_m, strict=True)):
        sums[0, k + 1] = max(0.0, sums[0, k] + move_m - slack_m)
        sums[1, k + 1] = max(0.0, sums[1, k] - move_m - slack_m)
    return sums[:, 1:].max(axis=0)


def _first(
    amounts: Floats, limit: float, scale: Floats, offset: int, slack: Floats | float = 0.0
) -> tuple[int, float] | None:
    """Step and rate of the first amount that exceeds `limit` · `scale` by more than rounding."""
    over = amounts > limit * scale * (1.0 + TOLERANCE) + slack
    if not np.any(over):
        return None
    k = int(np.argmax(over))
    rate = float(amounts[k]) / float(scale[k]) if scale[k] > 0.0 else math.inf
    return k + offset, rate
