"""Localization of a whole run by its odometry and observations: estimates, and their quality."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import gammaincinv

from omnisim.core.arrays import Floats, Indices
from omnisim.core.files.atomic_file import write_text
from omnisim.core.poses import wrap_angles
from omnisim.core.short_repr import counted, short_repr
from omnisim.core.trajectories import Trajectory, write_trajectory
from omnisim.core.trajectories.odometry import Odometry
from omnisim.perception.landmarks.landmark_detector import Detection
from omnisim.perception.localization.filter import (
    Estimate,
    FilterParameters,
    LandmarkMap,
    LocalizationFilter,
    MeasurementNoise,
    Observation,
)


def observation_from_detection(detection: Detection, noise: MeasurementNoise) -> Observation:
    """Observation of a detection, with its range by the relation in the parameters."""
    is_eq2 = noise.relation == "eq2" and math.isfinite(detection.range_eq2_m)
    return Observation(
        (detection.landmark,),
        detection.range_eq2_m if is_eq2 else detection.range_m,
        detection.bearing_rad,
        detection.range_sigma_m,
        detection.bearing_sigma_rad,
    )


def localize(
    odometry: Odometry,
    observations: Sequence[Sequence[Observation]],
    landmarks: LandmarkMap,
    parameters: FilterParameters,
    camera_m: tuple[float, float],
    covariance: ArrayLike | None = None,
) -> Track:
    """Localize a robot along a run from the known start and the observations of each later step.

    `camera_m` is x and y of the effective viewpoint in the base frame; `covariance` (3, 3) is the
    start's, by default from the parameters.

    Raises:
        LocalizationError: invalid readings or observations.
    """
    times = odometry.times_s
    robot = LocalizationFilter(
        landmarks, parameters, camera_m, float(times[0]), odometry.start, covariance
    )
    estimates = [robot.estimate]
    for step in range(1, len(observations)):
        time_s = float(times[step])
        speed = float(odometry.distances_m[step - 1]) / (time_s - estimates[-1].time_s)
        turn = float(odometry.turns_rad[step - 1])
        estimates.append(robot.step(time_s, speed, turn, observations[step]))
    return Track(tuple(estimates), odometry.planar_poses[: len(observations)])


@dataclass(frozen=True, eq=False)
class Track:
    """Estimates of a run, one per step from the start, and x, y, yaw (n, 3) by dead reckoning."""

    estimates: tuple[Estimate, ...]
    reckoned: Floats

    def __repr__(self) -> str:
        return short_repr(self, counted(len(self.estimates), "estimate"))

    @property
    def times_s(self) -> Floats:
        """Times (n,) of the steps."""
        return np.array([estimate.time_s for estimate in self.estimates])

    @property
    def poses(self) -> Floats:
        """Poses x, y, yaw (n, 3)."""
        return np.array([estimate.pose for estimate in self.estimates])

    @property
    def covariances(self) -> Floats:
        """Covariances (n, 3, 3) of the poses."""
        return np.array([estimate.covariance for estimate in self.estimates])

    def counts(self, accepted: bool) -> Indices:
        """Numbers (n,) of accepted, or of rejected, observations."""
        return np.array([
            sum((each.verdict == "accepted") == accepted for each in estimate.associations)
            for estimate in self.estimates
        ])  # fmt: skip

    @property
    def gate_opening_step(self) -> int | None:
        """First step that accepts at least half of its observations; None: no step does."""
        accepted, rejected = self.counts(True), self.counts(False)
        steps = np.flatnonzero((accepted > 0) & (accepted >= rejected))
        return int(steps[0]) if len(steps) else None

    def errors_m(self, true_poses: Floats) -> Floats:
        """Distances (n,) of the estimates from the true positions."""
        return np.linalg.norm(self.poses[:, :2] - true_poses[:, :2], axis=1)

    def reckoned_errors_m(self, true_poses: Floats) -> Floats:
        """Distances (n,) of dead reckoning from the true positions."""
        return np.linalg.norm(self.reckoned[:, :2] - true_poses[:, :2], axis=1)

    def nees(self, true_poses: Floats) -> Floats:
        """Normalized estimation error squared (n,); NaN where the covariance is singular."""
        return nees(pose_errors(self.poses, true_poses), self.covariances)


def notices(track: Track, parameters: FilterParameters) -> list[str]:
    """Notices of long rejection and of steps without observations."""
    texts, limit = [], parameters.measurement.report_after_steps
    first = None
    for step, estimate in enumerate((*track.estimates, None)):
        if estimate is not None and estimate.steps_rejected > 0:
            first = step if first is None else first
            continue
        if first is not None and step - first >= limit:
            texts.append(
                f"steps {first} to {step - 1}: no observed landmark passed the gate; the estimate "
                "relied on the wheels, and its uncertainty grew"
            )
        first = None
    blind = [k for k, estimate in enumerate(track.estimates) if k and not estimate.associations]
    if blind:
        shown = ", ".join(map(str, blind[:8])) + (", ..." if len(blind) > 8 else "")
        texts.append(f"{len(blind)} of {len(track.estimates) - 1} steps show no landmark: {shown}")
    return texts


# Consistency of a filter: NEES and NIS against their χ² bounds.
#
# Source: Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and Navigation,
# 2001, section 5.4.


class Interval(NamedTuple):
    """Probability interval of a mean."""

    low: float
    high: float


def mean_interval(degrees: int, count: int, share: float = 0.95) -> Interval:
    """Two-sided interval that contains the mean of χ² values with probability `share`.

    The mean is that of `count` independent values, each with `degrees` degrees of freedom.
    """
    tail = 0.5 * (1.0 - share)
    # quantiles of chi-square: those of a gamma distribution; `scipy.stats` is slow to import
    halves = 0.5 * degrees * count
    low, high = (2.0 * float(gammaincinv(halves, share)) for share in (tail, 1.0 - tail))
    return Interval(low / count, high / count)


def pose_errors(estimated: ArrayLike, true: ArrayLike) -> Floats:
    """Estimated minus true poses (..., 3): x and y in m, yaw in rad within ±π."""
    errors = np.asarray(estimated, dtype=np.float64) - np.asarray(true, dtype=np.float64)
    errors[..., 2] = wrap_angles(errors[..., 2])
    return errors


def nees(errors: Floats, covariances: Floats) -> Floats:
    """Normalized estimation errors squared (n,) of errors (n, 3) by covariances (n, 3, 3).

    NaN where a covariance is singular, as that of an exactly known start.
    """
    errors_squared = np.full(len(errors), np.nan)
    for k, (error, covariance) in enumerate(zip(errors, covariances, strict=True)):
        values, axes = np.linalg.eigh(covariance)
        if values[0] > 1e-14 * max(values[-1], 1e-300):
            errors_squared[k] = float(np.sum(np.square(axes.T @ error) / values))
    return errors_squared


# Files of a track: a trajectory, a table with covariances, and the data associations.


ESTIMATE_TUM, ESTIMATE_CSV = "estimate.tum", "estimate.csv"
MEASUREMENTS = "measurements.csv"
_ESTIMATE_COLUMNS = (
    "t_s,x_m,y_m,yaw_rad,xx_m2,xy_m2,x_yaw_m_rad,yy_m2,y_yaw_m_rad,yaw_yaw_rad2,"
    "accepted,rejected,nis,nis_degrees"
)
_MEASUREMENT_COLUMNS = (
    "step,t_s,landmark,range_m,bearing_rad,range_innovation_m,bearing_innovation_rad,"
    "mahalanobis_squared,verdict"
)


def write_track(folder: Path, track: Track) -> None:
    """Write `estimate.tum`, `estimate.csv` and `measurements.csv` into an existing folder.

    Raises:
        OutputError: a file cannot be written.
    """
    poses = track.poses
    trajectory = Trajectory.on_ground(track.times_s, poses[:, :2], poses[:, 2])
    write_trajectory(folder / ESTIMATE_TUM, trajectory)
    upper = np.triu_indices(3)
    accepted, rejected = track.counts(True), track.counts(False)
    lines = [_ESTIMATE_COLUMNS]
    for k, estimate in enumerate(track.estimates):
        numbers = (estimate.time_s, *estimate.pose, *estimate.covariance[upper])
        cells = [f"{number:.12g}" for number in numbers]
        nis = f"{estimate.nis:.6g}" if math.isfinite(estimate.nis) else ""
        cells += [str(accepted[k]), str(rejected[k]), nis, str(estimate.nis_degrees)]
        lines.append(",".join(cells))
    write_text(folder / ESTIMATE_CSV, "\n".join(lines) + "\n")
    lines = [_MEASUREMENT_COLUMNS]
    for step, estimate in enumerate(track.estimates):
        for association in estimate.associations:
            cells = [str(step), f"{estimate.time_s:.9f}", association.landmark]
            cells += [f"{number:.6f}" for number in association[1:-1]]
            lines.append(",".join((*cells, association.verdict)))
    write_text(folder / MEASUREMENTS, "\n".join(lines) + "\n")
