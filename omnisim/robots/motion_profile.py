"""Motion profiles along waypoints: turns on the spot and straight legs, at rest in between.

Every turn and leg has a trapezoidal velocity profile from rest to rest: constant acceleration, the
top speed if the distance suffices to reach it, constant braking. A half turn goes left.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from omnisim.core.errors import TrajectoryError
from omnisim.core.poses import wrap_angle
from omnisim.core.trajectories.trajectory import Trajectory
from omnisim.robots.kinematics import Kinematics
from omnisim.robots.planned_motion import PlannedMotion, Segment, in_sequence
from omnisim.robots.waypoints import check_waypoints

MAX_POSES = 1_000_000
# Smaller turns are rounding of the waypoints; half turns within this tolerance go left as well.
MIN_TURN_RAD = 1e-9


@dataclass(frozen=True, eq=False)
class Plan:
    """Planned drive along waypoints.

    Attributes:
        trajectory: poses at the start and after each step.
        motion: continuous motion, defined at all times.
        counts: number of steps per segment of the motion.
        period_s: duration of every step; None: the steps of a segment have equal lengths instead.
    """

    trajectory: Trajectory
    motion: PlannedMotion
    counts: tuple[int, ...]
    period_s: float | None = None


def plan_in_steps(
    waypoints_m: ArrayLike,
    kinematics: Kinematics,
    step_m: float,
    step_rad: float,
    start_yaw_rad: float | None = None,
) -> Plan:
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
) -> Plan:
    """Plan a drive along waypoints with a pose every `period_s`.

    Each leg and turn is slowed down to last a whole number of periods. There is a pose at each
    waypoint before its turn and another after it, and no step mixes a leg with a turn.

    Args:
        waypoints_m: (n, 2) positions in the world.
        kinematics: limits of the robot.
        period_s: time between poses.
        start_yaw_rad: heading at the first waypoint; None: toward the second one.

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


def _sample(segments: list[Segment], counts: list[int], period_s: float | None = None) -> Plan:
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
            dataclasses.replace(one, stretch=count * period_s / one.duration_s)
            for one, count in zip(segments, counts, strict=True)
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
    return Plan(trajectory, PlannedMotion(segments), tuple(counts), period_s)
