"""Errors of an estimated trajectory.

Sources: Sturm et al., "A benchmark for the evaluation of RGB-D SLAM systems", IROS 2012 (absolute
trajectory error and relative pose error); Geiger et al., "Are we ready for autonomous driving?",
CVPR 2012 (drift over segments of constant length).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import TrajectoryError
from omnisim.core.poses import inverse, rotation_angles
from omnisim.core.trajectories import Trajectory
from omnisim.core.trajectories.trajectory import step_lengths_m
from omnisim.evaluation.trajectory_alignment import Alignment, AlignmentKind, align

Floats = NDArray[np.float64]
MIN_POSES = 3
MAX_OFFSET_S = 0.5e-3  # between the times of a pose and of its true state
MAX_PERIODS = 4.0  # gap between two poses, in median periods; tracking is lost in a longer gap
SEGMENTS = 10  # segments of the path for drift


@dataclass(frozen=True, eq=False)
class TrajectoryErrors:
    """Errors of an estimated trajectory.

    Attributes:
        kind: kind of the alignment.
        alignment: transform from the estimate's world to the true one.
        poses: number of estimated poses with a true state.
        path_length_m: length of the true path between the first and the last of these poses.
        ate_m: root mean square distance of the aligned positions (absolute trajectory error).
        rpe_m, rpe_deg: root mean square error of the motion between successive poses (relative
            pose error), after scaling by the alignment.
        drift: mean error of the motion over a tenth of the path, as a share of that length.
        drift_degpm: mean error of the rotation over a tenth of the path, per meter.
        scale: ratio of true to estimated lengths.
        yaw_deg: root mean square error of the aligned headings.
        gravity_deg: root mean square angle between the true and the estimated direction of gravity
            in the robot's frame, without alignment; NaN: not estimated.
        lost: share of the drive's duration in `lost_intervals`.
    """

    kind: AlignmentKind
    alignment: Alignment
    poses: int
    path_length_m: float
    ate_m: float
    rpe_m: float
    rpe_deg: float
    drift: float
    drift_degpm: float
    scale: float
    yaw_deg: float
    gravity_deg: float
    lost: float


def match_times(
    times_s: Floats, true_times_s: Floats, tolerance_s: float = MAX_OFFSET_S
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Indices (k,) of the poses with a true state within the tolerance, and of those states."""
    after = np.clip(np.searchsorted(true_times_s, times_s), 1, max(len(true_times_s) - 1, 1))
    before = after - 1
    is_before = times_s - true_times_s[before] <= true_times_s[after] - times_s
    nearest = np.where(is_before, before, after)
    used = np.flatnonzero(np.abs(true_times_s[nearest] - times_s) <= tolerance_s)
    return used, nearest[used]


def lost_intervals(times_s: Floats, start_s: float, end_s: float) -> list[tuple[float, float]]:
    """Starts and ends of the intervals without an estimate, in seconds.

    They are the times before the first pose, after the last one, and in gaps of more than
    `MAX_PERIODS` median periods.

    Args:
        times_s: (n,) times of the estimated poses.
        start_s, end_s: start and end of the true motion.
    """
    if not len(times_s):
        return [(start_s, end_s)]
    gaps_s = np.diff(times_s)
    period_s = float(np.median(gaps_s)) if len(gaps_s) else 0.0
    inner = np.flatnonzero(gaps_s > MAX_PERIODS * period_s)
    found = [(float(times_s[one]), float(times_s[one + 1])) for one in inner]
    found = [(start_s, float(times_s[0])), *found, (float(times_s[-1]), end_s)]
    return [(start, end) for start, end in found if end - start > 0.0]


def trajectory_errors(
    estimate: Trajectory, truth: Trajectory, kind: AlignmentKind
) -> TrajectoryErrors:
    """Measure the errors of an estimated trajectory.

    Args:
        estimate: poses of the tracked frame, in any world; in the true world for "none".
        truth: true poses of the same frame, at the estimate's times among others.
        kind: "none", "se3" or "sim3".

    Raises:
        TrajectoryError: fewer than three poses have a true state.
    """
    used, nearest = match_times(estimate.times_s, truth.times_s)
    if len(used) < MIN_POSES:
        raise TrajectoryError(
            f"{len(used)} of {len(estimate)} poses have a true state at their time: "
            f"expected at least {MIN_POSES}"
        )
    poses, true = estimate.world_from_base[used], truth.world_from_base[nearest]
    alignment = align(poses, true, kind)
    aligned = alignment.apply(poses)
    offsets = np.linalg.norm(aligned[:, :3, 3] - true[:, :3, 3], axis=1)
    steps = _motion_errors(aligned, true, 1)
    drift, turn_drift = _drift(aligned, true)
    down = poses[:, 2, :3], true[:, 2, :3]  # the world's vertical in the robot's frame
    cosines = np.clip((down[0] * down[1]).sum(axis=1), -1.0, 1.0)
    yaw = rotation_angles(_leveled(aligned), _leveled(true))
    ends_s = float(truth.times_s[0]), float(truth.times_s[-1])
    lost_s = sum(end - start for start, end in lost_intervals(estimate.times_s[used], *ends_s))
    return TrajectoryErrors(
        kind,
        alignment,
        len(used),
        float(step_lengths_m(true).sum()),
        _rms(offsets),
        _rms(steps[0]),
        math.degrees(_rms(steps[1])),
        drift,
        turn_drift,
        align(poses, true, "sim3").scale,
        math.degrees(_rms(yaw)),
        math.degrees(_rms(np.arccos(cosines))),
        lost_s / truth.duration_s if truth.duration_s > 0.0 else 0.0,
    )


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _motion_errors(poses: Floats, true: Floats, step: int) -> tuple[Floats, Floats]:
    """Translation and rotation errors (n − step,) of the motions over `step` poses, m and rad."""
    motion = inverse(poses[:-step]) @ poses[step:]
    true_motion = inverse(true[:-step]) @ true[step:]
    return _pose_errors(motion, true_motion)


def _pose_errors(motions: Floats, true_motions: Floats) -> tuple[Floats, Floats]:
    errors = inverse(true_motions) @ motions
    lengths: Floats = np.linalg.norm(errors[:, :3, 3], axis=1)
    identity = np.broadcast_to(np.eye(3), errors[:, :3, :3].shape)
    return lengths, rotation_angles(identity, errors[:, :3, :3])


def _drift(poses: Floats, true: Floats) -> tuple[float, float]:
    """Mean errors over a tenth of the path: as a share of that length, and degrees per meter."""
    traveled_m = np.concatenate(([0.0], np.cumsum(step_lengths_m(true))))
    length = traveled_m[-1] / SEGMENTS
    if length <= 0.0:
        return math.nan, math.nan
    ends = np.searchsorted(traveled_m, traveled_m + length - 1e-9)
    starts = np.flatnonzero(ends < len(traveled_m))
    ends = ends[starts]
    motions = inverse(poses[starts]) @ poses[ends]
    lengths, angles = _pose_errors(motions, inverse(true[starts]) @ true[ends])
    covered_m = traveled_m[ends] - traveled_m[starts]
    return float(np.mean(lengths / covered_m)), math.degrees(float(np.mean(angles / covered_m)))


def _leveled(poses: Floats) -> Floats:
    """Rotations (n, 3, 3) about the vertical with the headings of poses (n, 4, 4)."""
    yaw = np.arctan2(poses[:, 1, 0], poses[:, 0, 0])
    cosines, sines = np.cos(yaw), np.sin(yaw)
    level = np.zeros((len(poses), 3, 3))
    level[:, 0, 0], level[:, 0, 1], level[:, 1, 0], level[:, 1, 1] = cosines, -sines, sines, cosines
    level[:, 2, 2] = 1.0
    return level
