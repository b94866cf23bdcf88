"""From sightings and wheel readings to where a robot believes to be, step by step."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from omnisim.localization.consistency import nees, pose_errors
from omnisim.localization.filter import Estimate, LocalizationFilter
from omnisim.localization.parameters import FilterParameters, Measurement
from omnisim.localization.sightings import LandmarkMap, Sighting
from omnisim.perception.landmark_detector import Detection
from omnisim.robot.odometry import Odometry


@dataclass(frozen=True, eq=False)
class Track:
    """The estimates of a run, one a step; the first is the start.

    Attributes:
        estimates: of the filter.
        reckoned: (n, 3) x, y, yaw by the wheels alone.
    """

    estimates: tuple[Estimate, ...]
    reckoned: NDArray[np.float64]

    @property
    def times_s(self) -> NDArray[np.float64]:
        """Of the steps (n,)."""
        return np.array([estimate.time_s for estimate in self.estimates])

    @property
    def poses(self) -> NDArray[np.float64]:
        """x, y, yaw (n, 3)."""
        return np.array([estimate.pose for estimate in self.estimates])

    @property
    def covariances(self) -> NDArray[np.float64]:
        """Of the poses (n, 3, 3)."""
        return np.array([estimate.covariance for estimate in self.estimates])

    def counts(self, accepted: bool) -> NDArray[np.intp]:
        """How many sightings were let through (n,), or were not."""
        return np.array(
            [
                sum((judged.verdict == "accepted") == accepted for judged in estimate.judgements)
                for estimate in self.estimates
            ]
        )

    @property
    def gate_opens(self) -> int | None:
        """The first step at which most of what is seen is let through, or None: at none."""
        accepted, rejected = self.counts(True), self.counts(False)
        steps = np.flatnonzero((accepted > 0) & (accepted >= rejected))
        return int(steps[0]) if len(steps) else None

    def errors_m(self, true_poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distance from the true position (n,)."""
        return np.linalg.norm(self.poses[:, :2] - true_poses[:, :2], axis=1)

    def reckoned_errors_m(self, true_poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """The same by the wheels alone."""
        return np.linalg.norm(self.reckoned[:, :2] - true_poses[:, :2], axis=1)

    def nees(self, true_poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """Normalised estimation error squared (n,); NaN where there is no doubt at all."""
        return nees(pose_errors(self.poses, true_poses), self.covariances)


def sighting_of(detection: Detection, relation: Measurement) -> Sighting:
    """A detection as the filter takes it, its range by the relation that the file names."""
    is_paper = relation.relation == "eq2" and math.isfinite(detection.range_eq2_m)
    return Sighting(
        (detection.landmark,),
        detection.range_eq2_m if is_paper else detection.range_m,
        detection.bearing_rad,
        detection.range_sigma_m,
        detection.bearing_sigma_rad,
    )


def localize(
    odometry: Odometry,
    sightings: Sequence[Sequence[Sighting]],
    landmarks: LandmarkMap,
    parameters: FilterParameters,
    camera_m: tuple[float, float],
    covariance: ArrayLike | None = None,
) -> Track:
    """Run the filter along a run.

    Args:
        odometry: readings, from the start that is known.
        sightings: of each step; those of the first are not used: the start is known.
        landmarks: where they are.
        parameters: of the filter.
        camera_m: x and y of the effective viewpoint in the base frame.
        covariance: (3, 3) of the start, or None: by the parameters.

    Raises:
        LocalizationError: readings or sightings that cannot be.
    """
    times = odometry.times_s
    robot = LocalizationFilter(
        landmarks, parameters, camera_m, float(times[0]), odometry.start, covariance
    )
    estimates = [robot.estimate]
    for k in range(1, len(sightings)):
        time_s = float(times[k])
        speed = float(odometry.distances_m[k - 1]) / (time_s - estimates[-1].time_s)
        turn = float(odometry.turns_rad[k - 1])
        estimates.append(robot.step(time_s, speed, turn, sightings[k]))
    return Track(tuple(estimates), odometry.planar_poses[: len(sightings)])


def notices(track: Track, parameters: FilterParameters) -> list[str]:
    """What somebody should know: for how long nothing was let through, or nothing was seen."""
    told, limit = [], parameters.measurement.report_after_steps
    first = None
    for k, estimate in enumerate((*track.estimates, None)):
        if estimate is not None and estimate.steps_rejected > 0:
            first = k if first is None else first
            continue
        if first is not None and k - first >= limit:
            told.append(
                f"steps {first} to {k - 1}: none of the landmarks that were seen passed the gate; "
                "the estimate went by the wheels, and its doubt grew"
            )
        first = None
    blind = [k for k, estimate in enumerate(track.estimates) if k and not estimate.judgements]
    if blind:
        shown = ", ".join(map(str, blind[:8])) + (", ..." if len(blind) > 8 else "")
        told.append(f"{len(blind)} of {len(track.estimates) - 1} steps show no landmark: {shown}")
    return told
