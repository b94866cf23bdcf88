"""Errors of an estimated trajectory after its alignment."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
import scipy  # its submodules load on first use

from omnisim.cameras import CentralCamera
from omnisim.cameras.camera import pixel_grid
from omnisim.core.arrays import Floats, Indices
from omnisim.core.errors import EstimatorError, TrajectoryError
from omnisim.core.poses import (
    inverse,
    nearest_rotation,
    rotation_angles,
    rotation_from_yaw,
    yaw_from_rotation,
)
from omnisim.core.trajectories import Trajectory
from omnisim.core.trajectories.trajectory import step_lengths_m

MIN_POSES = 3
MAX_OFFSET_S = 0.5e-3  # between the times of a pose and of its true state
MAX_PERIODS = 4.0  # gap between two poses, in median periods; tracking is lost in a longer gap
SEGMENTS = 10  # segments of the path for drift


@dataclass(frozen=True, eq=False)
class TrajectoryErrors:
    """Errors of an estimated trajectory."""

    kind: AlignmentKind  # kind of the alignment
    alignment: Alignment  # transform from the estimate's world to the true one
    poses: int  # number of estimated poses with a true state
    path_length_m: float  # length of the true path between the first and the last of these poses
    ate_m: float  # root mean square distance of the aligned positions (absolute trajectory error)
    # rpe_m, rpe_deg: root mean square error of the motion between successive poses (relative pose
    # error), after scaling by the alignment
    rpe_m: float
    rpe_deg: float
    drift: float  # mean error of the motion over a tenth of the path, as a share of that length
    drift_degpm: float  # mean error of the rotation over a tenth of the path, per meter
    scale: float  # ratio of true to estimated lengths
    yaw_deg: float  # root mean square error of the aligned headings
    # root mean square angle between the true and the estimated direction of gravity in the robot's
    # frame, without alignment; NaN: not estimated
    gravity_deg: float
    lost: float  # share of the drive's duration in `lost_intervals`


def match_times(
    times_s: Floats, true_times_s: Floats, tolerance_s: float = MAX_OFFSET_S
) -> tuple[Indices, Indices]:
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
    found = [(float(times_s[index]), float(times_s[index + 1])) for index in inner]
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
    motions, true_motions = (inverse(poses[:-1]) @ poses[1:] for poses in (aligned, true))
    steps = _pose_errors(motions, true_motions)
    drift, turn_drift = _drift(aligned, true)
    down = poses[:, 2, :3], true[:, 2, :3]  # the world's vertical in the robot's frame
    cosines = np.clip((down[0] * down[1]).sum(axis=1), -1.0, 1.0)
    level, true_level = (rotation_from_yaw(yaw_from_rotation(poses)) for poses in (aligned, true))
    yaw = rotation_angles(level, true_level)
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


def _pose_errors(motions: Floats, true_motions: Floats) -> tuple[Floats, Floats]:
    """Errors (n,) of the translations, m, and of the rotations, rad, of motions (n, 4, 4)."""
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


# Alignment of an estimated trajectory with the true one.
#
# Source: Umeyama, "Least-squares estimation of transformation parameters between two point
# patterns", PAMI 1991.


AlignmentKind = Literal["none", "se3", "sim3"]
_RANK_TOLERANCE = 1e-12  # as a share of the largest singular value


@dataclass(frozen=True, eq=False)
class Alignment:
    """Similarity transform from an estimate's world to the true world."""

    rotation: Floats  # (3, 3) rotation matrix
    translation_m: Floats  # (3,) translation in the true world
    scale: float = 1.0  # factor of the estimate's lengths, applied first

    def apply(self, poses: Floats) -> Floats:
        """Aligned poses (n, 4, 4); rotations stay rotations."""
        aligned = np.array(poses, dtype=np.float64)
        aligned[:, :3, :3] = self.rotation @ poses[:, :3, :3]
        aligned[:, :3, 3] = self.scale * poses[:, :3, 3] @ self.rotation.T + self.translation_m
        return aligned


def align(estimate: Floats, truth: Floats, kind: AlignmentKind) -> Alignment:
    """Least-squares alignment of positions.

    If the positions lie on a line or in a point, many rotations are equally good; the rotation then
    aligns the first poses.

    Args:
        estimate, truth: (n, 4, 4) poses at the same times.
        kind: "none", "se3" (rotation and translation) or "sim3" (scale, too).
    """
    if kind == "none":
        return Alignment(np.eye(3), np.zeros(3))
    estimated, true = estimate[:, :3, 3], truth[:, :3, 3]
    centers = estimated.mean(axis=0), true.mean(axis=0)
    spread = float(np.square(estimated - centers[0]).sum() / len(estimated))
    covariance = (true - centers[1]).T @ (estimated - centers[0]) / len(estimated)
    left, sizes, right = np.linalg.svd(covariance)
    if sizes[1] <= _RANK_TOLERANCE * max(float(sizes[0]), 1.0):
        rotation = truth[0, :3, :3] @ estimate[0, :3, :3].T
        return Alignment(rotation, true[0] - rotation @ estimated[0])
    signs = np.ones(3)
    signs[2] = np.sign(np.linalg.det(left) * np.linalg.det(right))
    rotation = left @ np.diag(signs) @ right
    scale = float(sizes @ signs / spread) if kind == "sim3" else 1.0
    return Alignment(rotation, centers[1] - scale * rotation @ centers[0], scale)


# Errors of a calibrated camera.


STEP_PX = 8  # spacing of the grid over the image
NEAR_AXIS_RAD = 1e-3


@dataclass(frozen=True)
class CameraErrors:
    """Errors of a calibrated camera over all pixels that have a true ray.

    A calibration does not determine the lens's orientation in its housing. The rays are therefore
    aligned with the true ones by the best rotation first.
    """

    model: str  # name of the estimated model
    # relative error of the focal length at the axis; NaN: the axis is outside of the image
    focal_length: float
    rms_px: float  # root mean square distance of the pixels of true rays from the true pixels
    max_px: float  # largest such distance
    covered: float  # share of the true rays that the estimated model projects to a pixel

    @property
    def summary(self) -> str:
        """Model and errors in one line of text."""
        return (
            f"{self.model}: focal length {100.0 * self.focal_length:+z.3f} %, {self.rms_px:.3f} px "
            f"RMS, at most {self.max_px:.3g} px, over {100.0 * self.covered:.4g} % of the image"
        )


def camera_errors(estimate: CentralCamera, truth: CentralCamera) -> CameraErrors:
    """Compare a calibrated camera with the true one.

    Args:
        estimate: calibrated camera.
        truth: true camera, of the same image size.

    Raises:
        EstimatorError: the two cameras have no rays in common.
    """
    pixels = pixel_grid(truth.width_px, truth.height_px)[::STEP_PX, ::STEP_PX].reshape(-1, 2)
    true_rays, rays = truth.ray_from_pixel(pixels), estimate.ray_from_pixel(pixels)
    both = true_rays.valid & rays.valid
    if both.sum() < 3:
        raise EstimatorError("the calibrated camera has no rays in common with the true one")
    estimate_from_true = nearest_rotation(rays.directions[both].T @ true_rays.directions[both])
    seen = true_rays.valid
    found = estimate.pixel_from_ray(true_rays.directions[seen] @ estimate_from_true.T)
    offsets = np.linalg.norm(found.positions_px - pixels[seen], axis=1)[found.valid]
    return CameraErrors(
        estimate.model_name,
        _focal_length_px(estimate) / _focal_length_px(truth) - 1.0,
        _rms(offsets),
        float(offsets.max()),
        float(found.valid.mean()),
    )


def _focal_length_px(camera: CentralCamera) -> float:
    """Pixels per radian at the axis, mean of u and v; NaN: the axis has no pixel."""
    small = NEAR_AXIS_RAD * np.array([(1, 0), (-1, 0), (0, 1), (0, -1)], dtype=np.float64)
    ends = camera.pixel_from_ray(np.column_stack((small, np.ones(4))))
    if not ends.valid.all():
        return float("nan")
    spans = np.linalg.norm(ends.positions_px[::2] - ends.positions_px[1::2], axis=1)
    return float(spans.mean() / (2.0 * np.arctan(NEAR_AXIS_RAD)))


# Mean of a measure over seeds, with its confidence interval.


CONFIDENCE = 0.95


class SeedMean(NamedTuple):
    """Mean over seeds."""

    mean: float  # mean of the finite values; NaN: there are none
    # half of the mean's `CONFIDENCE` interval, by Student's t; NaN: fewer than two finite values
    half_width: float
    seeds: int  # number of finite values


def over_seeds(values: Sequence[float]) -> SeedMean:
    """Mean of the finite values among those of independent seeds."""
    known = [value for value in values if math.isfinite(value)]
    count = len(known)
    if count < 2:
        return SeedMean(known[0] if known else math.nan, math.nan, count)
    quantile = float(scipy.special.stdtrit(count - 1, 0.5 + 0.5 * CONFIDENCE))
    return SeedMean(
        statistics.fmean(known), quantile * statistics.stdev(known) / math.sqrt(count), count
    )
