"""Motion profiles along waypoints, and time-optimal timing of given poses.

Along waypoints every turn on the spot and every straight leg has a trapezoidal velocity profile
from rest to rest: constant acceleration, the top speed if the distance suffices to reach it,
constant braking. A half turn goes left.
"""

from __future__ import annotations

import dataclasses
import math
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from omnisim.core.arrays import Floats, Indices
from omnisim.core.errors import TrajectoryError
from omnisim.core.poses import MAX_M, pose_from_rotation, rotation_from_yaw, wrap_angle
from omnisim.core.trajectories.body_motion import BodyMotion, MotionStates, SplineMotion
from omnisim.core.trajectories.formats.parsed_trajectory import read_text_table
from omnisim.core.trajectories.trajectory import Trajectory, check_poses
from omnisim.robots.kinematics import Kinematics, steps_between

MAX_POSES = 1_000_000
# Smaller turns are rounding of the waypoints; half turns within this tolerance go left as well.
MIN_TURN_RAD = 1e-9
# Durations grow until no mean rate exceeds the limits by more than this relative tolerance.
CONVERGED = 1e-9


@dataclass(frozen=True, eq=False)
class MotionPlan:
    """Planned drive along waypoints."""

    trajectory: Trajectory  # poses at the start and after each step
    motion: PlannedMotion  # continuous motion, defined at all times
    counts: tuple[int, ...]  # number of steps per segment of the motion
    # duration of every step; None: the steps of a segment have equal lengths instead
    period_s: float | None = None


def plan_in_steps(
    waypoints_m: ArrayLike,
    kinematics: Kinematics,
    step_m: float,
    step_rad: float,
    start_yaw_rad: float | None = None,
) -> MotionPlan:
    """Plan a drive along waypoints with steps of limited length.

    Each leg or turn is cut into the smallest number of equal steps that keeps to the maximum
    length. There is a pose at each waypoint before its turn and another after it.

    Args:
        waypoints_m: (n, 2) positions in the world.
        kinematics: limits of the robot.
        step_m: maximum step length on a leg.
        step_rad: maximum step angle in a turn.
        start_yaw_rad: heading at the first waypoint; None: toward the second one.

    Raises:
        TrajectoryError: invalid waypoints or steps, or too many poses.
    """
    for name, value, most in (("step_m", step_m, math.inf), ("step_rad", step_rad, math.pi / 2.0)):
        if not 0.0 < value <= most:
            raise TrajectoryError(f"{name} = {value:g}: expected more than 0, at most {most:.6g}")
    segments = list(_segments(waypoints_m, kinematics, start_yaw_rad))
    counts = [
        _count(segment.amount / (step_m if segment.move_m != (0.0, 0.0) else step_rad))
        for segment in segments
    ]
    return _sample(segments, counts)


def plan_with_period(
    waypoints_m: ArrayLike,
    kinematics: Kinematics,
    period_s: float,
    start_yaw_rad: float | None = None,
) -> MotionPlan:
    """Plan a drive along waypoints with a pose every `period_s`.

    Each leg and turn is slowed down to last a whole number of periods. There is a pose at each
    waypoint before its turn and another after it, and no step mixes a leg with a turn. Further
    arguments are those of `plan_in_steps`.

    Raises:
        TrajectoryError: invalid waypoints or period, or too many poses.
    """
    if not 0.0 < period_s < math.inf:
        raise TrajectoryError(f"period_s = {period_s:g}: expected a finite number above 0")
    segments = list(_segments(waypoints_m, kinematics, start_yaw_rad))
    counts = [_count(segment.duration_s / period_s) for segment in segments]
    return _sample(segments, counts, period_s)


def _segments(
    waypoints_m: ArrayLike, kinematics: Kinematics, start_yaw_rad: float | None
) -> Iterator[Segment]:
    points = check_waypoints(waypoints_m)
    legs = np.diff(points, axis=0)
    headings = np.arctan2(legs[:, 1], legs[:, 0])
    yaw = float(headings[0]) if start_yaw_rad is None else start_yaw_rad
    if not math.isfinite(yaw):
        raise TrajectoryError(f"start_yaw_rad = {yaw}: expected a finite number")
    turning = (kinematics.max_turn_rate_radps, kinematics.max_turn_acceleration_radps2)
    driving = (kinematics.max_speed_mps, kinematics.max_acceleration_mps2)
    for point, leg, heading in zip(points, legs, headings.tolist(), strict=False):
        x, y = point.tolist()
        turn = wrap_angle(heading - yaw)
        if turn < MIN_TURN_RAD - math.pi:
            turn += 2.0 * math.pi
        if abs(turn) > MIN_TURN_RAD:
            yield Segment((x, y, yaw), (0.0, 0.0), turn, *turning)
        yaw = heading
        yield Segment((x, y, heading), tuple(leg.tolist()), 0.0, *driving)


def _count(steps: float) -> int:
    """Round up to whole steps; 5.4 m at 0.1 m per step are 54 in spite of rounding errors."""
    if steps > MAX_POSES:
        raise TrajectoryError(f"{steps:.3g} steps: expected at most {MAX_POSES}: make them longer")
    return max(1, math.ceil(steps - 1e-9))


def _sample(
    segments: list[Segment], counts: list[int], period_s: float | None = None
) -> MotionPlan:
    """Sample consecutive segments, each in its number of steps.

    With a period, all steps have equal durations. Without, the steps of a segment have equal
    lengths in meters or radians.
    """
    if sum(counts) > MAX_POSES:
        raise TrajectoryError(
            f"{sum(counts)} steps: expected at most {MAX_POSES}: make them longer"
        )
    if period_s is not None:
        segments = [
            dataclasses.replace(segment, stretch=count * period_s / segment.duration_s)
            for segment, count in zip(segments, counts, strict=True)
        ]
    segments = in_sequence(segments)
    times, poses = [np.zeros(1)], [np.array([segments[0].start])]
    for segment, count in zip(segments, counts, strict=True):
        shares = np.arange(1, count + 1) / count
        law = segment.trapezoid
        if period_s is None:
            times.append(segment.start_s + law.times_at(shares * segment.amount))
        else:
            shares = law.amounts_at(shares * law.duration_s) / segment.amount
        poses.append(segment.poses_at(shares))
    planar = np.concatenate(poses)
    stamps = np.concatenate(times) if period_s is None else period_s * np.arange(len(planar))
    trajectory = Trajectory.on_ground(stamps, planar[:, :2], planar[:, 2])
    return MotionPlan(trajectory, PlannedMotion(segments), tuple(counts), period_s)


def time_poses(world_from_base: Floats, kinematics: Kinematics) -> Trajectory:
    """Assign times to poses (n, 4, 4), from rest at 0 s to rest at the last pose.

    Each step first gets the duration that its speed and turn rate require. If the mean rates of two
    neighboring steps then differ by more than the accelerations allow, the faster step is
    lengthened, until no such pair is left. A neighbor without motion counts as rest, so the robot
    has to brake before it. Between poses only means are known. The result is therefore faster than
    `motion_profile`, whose speeds are exact, by less than one step's duration per top speed.

    Raises:
        TrajectoryError: invalid poses, or two successive poses are identical.
    """
    poses = np.asarray(world_from_base, dtype=np.float64)
    if poses.ndim != 3 or poses.shape[1:] != (4, 4) or not len(poses):
        raise TrajectoryError(f"trajectory: poses {poses.shape}: expected (n, 4, 4), n ≥ 1")
    check_poses(poses)
    steps = steps_between(poses)
    amounts = np.stack((steps.distances_m, steps.turns_rad))
    amounts[np.abs(amounts) < 1e-12] = 0.0  # rounding errors do not count as motion
    still = np.all(amounts == 0.0, axis=0)
    if np.any(still):
        k = int(np.argmax(still))
        raise TrajectoryError(
            f"trajectory: poses {k} and {k + 1} are the same: how long the robot waits there "
            "is unknown without times: expected one of them"
        )
    limits = (
        (kinematics.max_speed_mps, kinematics.max_acceleration_mps2),
        (kinematics.max_turn_rate_radps, kinematics.max_turn_acceleration_radps2),
    )
    durations = np.zeros(amounts.shape[1])
    for row, (rate, acceleration) in zip(amounts, limits, strict=True):
        durations = np.maximum(durations, np.abs(row) / rate)
        durations = np.maximum(durations, _from_rest_or_to_it(row, acceleration))
    _lengthen(durations, amounts, [acceleration for _, acceleration in limits])
    return Trajectory(np.concatenate(((0.0,), np.cumsum(durations))), poses)


def _from_rest_or_to_it(amounts: Floats, acceleration: float) -> Floats:
    """Durations (n,) of steps that start or end at rest, or both; 0 for all others."""
    moves = np.concatenate(((False,), amounts != 0.0, (False,)))
    rests = (~moves[:-2]).astype(int) + ~moves[2:]  # number of neighbors at rest: 0, 1 or 2
    return np.sqrt(2.0 * rests * np.abs(amounts) / acceleration)


def _lengthen(durations: Floats, amounts: Floats, accelerations: list[float]) -> None:
    """Lengthen durations (n,) in place until neighbors' mean rates satisfy the accelerations.

    The durations already satisfy the speeds and the steps next to rest; `amounts` (quantities, n)
    are distances and turn angles, with a limit each.
    """
    waiting = deque(range(len(durations) - 1))
    while waiting:
        k = waiting.popleft()
        for row, acceleration in zip(amounts, accelerations, strict=True):
            if row[k] == 0.0 or row[k + 1] == 0.0:
                continue  # `_from_rest_or_to_it` covers steps next to rest
            rates = row[k : k + 2] / durations[k : k + 2]
            reach = 0.5 * acceleration * float(durations[k] + durations[k + 1])
            if abs(rates[1] - rates[0]) <= reach * (1.0 + CONVERGED):
                continue
            fast, slow = (k, k + 1) if abs(rates[0]) > abs(rates[1]) else (k + 1, k)
            # |amount| / t ∓ |rate of the slower step| = acceleration (t + its duration) / 2
            sign = 1.0 if rates[0] * rates[1] > 0.0 else -1.0
            b = 0.5 * acceleration * float(durations[slow]) + sign * abs(float(rates[slow - k]))
            root = math.sqrt(b * b + 2.0 * acceleration * abs(float(row[fast])))
            durations[fast] = max(durations[fast], (root - b) / acceleration)
            waiting.extend(near for near in (fast - 1, fast) if 0 <= near < len(durations) - 1)


def check_waypoints(waypoints_m: ArrayLike) -> Floats:
    """Check waypoints and return them as float64 (n, 2).

    Raises:
        TrajectoryError: not (n, 2) with n ≥ 2, not finite, or a waypoint repeats the previous one.
    """
    try:
        points = np.array(waypoints_m, dtype=np.float64)
    except (TypeError, ValueError):
        raise TrajectoryError("waypoints: expected a list of [x, y] in meters") from None
    if points.shape in ((0,), (1, 2)):
        raise TrajectoryError(f"waypoints: expected at least 2, got {len(points)}")
    if points.ndim != 2 or points.shape[1] != 2:
        raise TrajectoryError(f"waypoints of shape {points.shape}: expected (n, 2)")
    finite = np.all(np.abs(points) < MAX_M, axis=1)  # also false for NaN
    if not np.all(finite):
        k = int(np.argmin(finite))
        raise TrajectoryError(
            f"waypoint {k} {points[k].tolist()}: expected finite numbers in meters"
        )
    same = np.all(points[1:] == points[:-1], axis=1)
    if np.any(same):
        k = int(np.argmax(same))
        raise TrajectoryError(f"waypoints {k} and {k + 1} are the same: expected one of them")
    return points


def read_waypoints(path: Path) -> Floats | None:
    """Read waypoints (n, 2) from a CSV file with exactly the columns x_m and y_m.

    Any other file returns None: with headings or times it is a trajectory.

    Raises:
        TrajectoryError: the file is invalid; names file, line, actual and expected text.
    """
    table = read_text_table(path)
    names = table.lines[0].cells
    if sorted(names) != ["x_m", "y_m"]:
        return None
    numbers = table.without_header().numbers(names)
    try:
        return check_waypoints(numbers[:, [names.index("x_m"), names.index("y_m")]])
    except TrajectoryError as reason:
        raise TrajectoryError(f"{path}: {reason}") from None


# Planned motion in closed form: legs and turns on the spot with trapezoidal speed profiles.
#
# Acceleration jumps at the corners of a trapezoid; speed and turn rate are continuous. Every
# segment starts and ends at rest.


FloatOrArray = TypeVar("FloatOrArray", float, Floats)


@dataclass(frozen=True)
class Trapezoid(Generic[FloatOrArray]):
    """Trapezoidal speed profile from rest to rest, of one motion or of (n,) motions."""

    amount: FloatOrArray  # distance in meters or angle in radians, above 0
    top_rate: FloatOrArray  # maximum rate, reached if the amount suffices
    acceleration: FloatOrArray  # magnitude while accelerating and braking

    @property
    def ramp_s(self) -> FloatOrArray:
        """Time to accelerate, which equals the time to brake."""
        a = self.acceleration
        return np.minimum(self.top_rate / a, np.sqrt(self.amount / a))

    @property
    def duration_s(self) -> FloatOrArray:
        """Time from rest to rest."""
        # the two ramps together cover what one ramp's time at the top rate would
        return self.ramp_s + self.amount / (self.acceleration * self.ramp_s)

    def amounts_at(self, times_s: Floats) -> Floats:
        """Distances or angles (n,) at times (n,) since the start."""
        ramp, a = self.ramp_s, self.acceleration
        left = self.duration_s - times_s
        cruising = a * ramp * (times_s - 0.5 * ramp)
        braking = self.amount - 0.5 * a * left * left
        speeding = 0.5 * a * times_s * times_s
        return np.where(times_s < ramp, speeding, np.where(left < ramp, braking, cruising))

    def rates_at(self, times_s: Floats) -> Floats:
        """Rates (n,) at times (n,) since the start."""
        a = self.acceleration
        left = self.duration_s - times_s
        return a * np.minimum(np.minimum(times_s, left), self.ramp_s)

    def accelerations_at(self, times_s: Floats) -> Floats:
        """Accelerations (n,) at times (n,) since the start."""
        ramp, a = self.ramp_s, self.acceleration
        left = self.duration_s - times_s
        return np.where(times_s < ramp, a, np.where(left < ramp, -a, 0.0))

    def times_at(self, amounts: Floats) -> Floats:
        """Times (n,) at distances or angles (n,): the inverse of `amounts_at`."""
        ramp, a = self.ramp_s, self.acceleration
        ramp_amount = 0.5 * a * ramp * ramp
        left = np.maximum(self.amount - amounts, 0.0)
        cruising = amounts / (a * ramp) + 0.5 * ramp
        braking = self.duration_s - np.sqrt(2.0 * left / a)
        speeding = np.sqrt(2.0 * amounts / a)
        return np.where(
            amounts < ramp_amount, speeding, np.where(left < ramp_amount, braking, cruising)
        )


@dataclass(frozen=True)
class Segment:
    """Leg or turn on the spot, from rest to rest."""

    start: tuple[float, float, float]  # x and y in meters, yaw in radians
    move_m: tuple[float, float]  # displacement of a leg; (0, 0) for a turn
    turn_rad: float  # angle of a turn; 0 for a leg
    # top_rate, acceleration: limits of its speed or turn rate
    top_rate: float
    acceleration: float
    start_s: float = 0.0  # start time
    stretch: float = 1.0  # duration relative to the time-optimal one
    # poses over meters or radians on an uneven floor; None: straight, or about z
    way: SplineMotion | None = None

    @property
    def planar_amount(self) -> float:
        """Meters or radians in the floor plan."""
        return math.hypot(*self.move_m) or abs(self.turn_rad)

    @property
    def amount(self) -> float:
        """Meters or radians along the actual motion, slopes included."""
        return self.planar_amount if self.way is None else self.way.end_s

    @property
    def trapezoid(self) -> Trapezoid[float]:
        """Speed profile before stretching."""
        return Trapezoid(self.amount, self.top_rate, self.acceleration)

    @property
    def duration_s(self) -> float:
        """Time from rest to rest."""
        return self.stretch * self.trapezoid.duration_s

    def poses_at(self, shares: Floats) -> Floats:
        """x, y, yaw (n, 3) at fractions (n,) of the motion in the floor plan."""
        change = np.array((*self.move_m, self.turn_rad))
        return np.array(self.start) + shares[:, None] * change


class PlannedMotion(BodyMotion):
    """Motion along consecutive segments, at one height where they have no `way`."""

    def __init__(self, segments: Sequence[Segment], height_m: float = 0.0):
        self.segments, self._height_m = tuple(segments), height_m
        self._starts_s = np.array([segment.start_s for segment in segments])
        self._stretch = np.array([segment.stretch for segment in segments])
        columns = [(segment.amount, segment.top_rate, segment.acceleration) for segment in segments]
        self._trapezoids = np.array(columns).T
        self._planar = np.array(
            [(*segment.start, *segment.move_m, segment.turn_rad) for segment in segments]
        )
        self._is_uneven = np.array([segment.way is not None for segment in segments])
        self.start_s = segments[0].start_s
        self.end_s = segments[-1].start_s + segments[-1].duration_s

    def at_height(self, height_m: float) -> PlannedMotion:
        """Copy of the motion with the base at another height on an even floor."""
        return PlannedMotion(self.segments, height_m)

    def _states(self, times_s: Floats) -> MotionStates:
        last = len(self.segments) - 1
        index = np.clip(np.searchsorted(self._starts_s, times_s, side="right") - 1, 0, last)
        stretch = self._stretch[index]
        times = (times_s - self._starts_s[index]) / stretch
        law = Trapezoid(*self._trapezoids[:, index])
        times = np.clip(times, 0.0, law.duration_s)
        rates, accelerations = law.rates_at(times), law.accelerations_at(times)
        states = self._even(
            index, law.amount, law.amounts_at(times), rates / stretch, accelerations / stretch**2
        )
        for number in np.unique(index[self._is_uneven[index]]).tolist():
            own = index == number
            part = Trapezoid(law.amount[own], law.top_rate[own], law.acceleration[own])
            way = self.segments[number].way
            assert way is not None
            moved = way.at(np.clip(part.amounts_at(times[own]), 0.0, way.end_s))
            rate = (rates / stretch)[own, None]
            acceleration = (accelerations / stretch**2)[own, None]
            states.world_from_base[own] = moved.world_from_base
            states.velocity_mps[own] = moved.velocity_mps * rate
            states.acceleration_mps2[own] = (
                moved.acceleration_mps2 * rate**2 + moved.velocity_mps * acceleration
            )
            states.angular_rate_radps[own] = moved.angular_rate_radps * rate
        return states

    def _even(
        self, index: Indices, amount: Floats, amounts: Floats, rates: Floats, accelerations: Floats
    ) -> MotionStates:
        """States (n,) on an even floor: straight, or about z."""
        start, change = self._planar[index, :3], self._planar[index, 3:]
        planar = start + (amounts / amount)[:, None] * change
        per_amount = change / amount[:, None]
        height_m = np.full(len(index), self._height_m)
        positions = np.column_stack((planar[:, :2], height_m))
        turn_rates = np.zeros((len(index), 3))
        turn_rates[:, 2] = per_amount[:, 2] * rates
        ahead = np.column_stack((per_amount[:, :2], np.zeros(len(index))))
        return MotionStates(
            pose_from_rotation(rotation_from_yaw(planar[:, 2]), positions),
            ahead * rates[:, None],
            ahead * accelerations[:, None],
            turn_rates,
        )


def in_sequence(segments: Sequence[Segment]) -> list[Segment]:
    """Chain segments in time: each starts when the previous one ends, the first at 0 s."""
    timed: list[Segment] = []
    start_s = 0.0
    for segment in segments:
        timed.append(dataclasses.replace(segment, start_s=start_s))
        start_s += segment.duration_s
    return timed
