"""Plans on the scene's floor: motion of a plan along slopes."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from omnisim.core.poses import wrap_angles, yaw_from_rotation
from omnisim.core.trajectories import Trajectory
from omnisim.core.trajectories.spline_motion import SplineMotion
from omnisim.core.trajectories.trajectory import step_lengths_m
from omnisim.robots.motion_profile import Plan
from omnisim.robots.planned_motion import PlannedMotion, Segment, in_sequence
from omnisim.runs.pose_sweep import Sweep

EVEN_M = 1e-9  # also radians: rounding on an even floor


def on_floor(plan: Plan, sweep: Sweep) -> tuple[Sweep, PlannedMotion]:
    """Time a plan's poses on the floor, and find the motion there.

    Steps of equal length keep the limits along the floor, and so last longer on slopes; steps of
    equal duration keep their times. Between the sweep's poses the motion is a spline.

    Args:
        plan: plan on a level floor.
        sweep: closely spaced poses along the plan, on the scene's floor.
    """
    poses = sweep.world_from_base
    heights_m = poses[:, 2, 3]
    if np.ptp(heights_m) < EVEN_M and np.abs(poses[:, 2, :2]).max() < EVEN_M:
        return sweep, plan.motion.at_height(float(heights_m[0]))
    bounds = np.searchsorted(sweep.steps, np.cumsum((0, *plan.counts)))
    segments, ways = [], []
    for number, segment in enumerate(plan.motion.segments):
        first, last = int(bounds[number]), int(bounds[number + 1])
        part = slice(first, last + 1)
        if segment.turn_rad != 0.0:
            yaw_rad = yaw_from_rotation(poses[part])
            steps = np.abs(wrap_angles(np.diff(yaw_rad)))
        elif plan.period_s is None:
            steps = _along_chords(poses[part], sweep.is_step[part])
        else:
            steps = np.linalg.norm(np.diff(poses[part, :2, 3], axis=0), axis=1)
        way = np.concatenate(((0.0,), np.cumsum(steps)))
        ways.append(way)
        spline = SplineMotion(Trajectory(way, poses[part]))
        segments.append(dataclasses.replace(segment, way=spline))
    if plan.period_s is not None:
        return sweep, PlannedMotion(segments)
    segments = in_sequence(segments)
    times = [segments[0].start_s + np.zeros(1)]
    times += [_times(one, way)[1:] for one, way in zip(segments, ways, strict=True)]
    return dataclasses.replace(sweep, times_s=np.concatenate(times)), PlannedMotion(segments)


def _along_chords(poses: NDArray[np.float64], is_step: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Distances (n − 1,) in meters between poses (n, 4, 4), scaled to sum to each step's chord.

    A bump within a step adds nothing to them: steps are checked by the length of their chords.
    """
    ways_m = step_lengths_m(poses)
    first = np.flatnonzero(is_step)[:-1]
    chords_m = step_lengths_m(poses[is_step])
    scales = chords_m / np.add.reduceat(ways_m, first)
    return ways_m * np.repeat(scales, np.diff(np.append(first, len(ways_m))))


def _times(segment: Segment, distances: NDArray[np.float64]) -> NDArray[np.float64]:
    """Times (n,), s, at distances (n,) along a segment, in meters or radians."""
    return segment.start_s + segment.trapezoid.times_at(distances)
