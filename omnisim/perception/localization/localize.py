"""Localization of a whole run by its odometry and observations."""

from __future__ import annotations

import math
from collections.abc import Sequence

from numpy.typing import ArrayLike

from omnisim.core.trajectories.odometry import Odometry
from omnisim.perception.landmarks.landmark_detector import Detection
from omnisim.perception.localization.filter import LandmarkMap, LocalizationFilter, Observation
from omnisim.perception.localization.filter_parameters import FilterParameters, MeasurementNoise
from omnisim.perception.localization.track import Track


def observation_from_detection(detection: Detection, relation: MeasurementNoise) -> Observation:
    """Observation of a detection, with its range by the relation in the parameters."""
    is_paper = relation.relation == "eq2" and math.isfinite(detection.range_eq2_m)
    return Observation(
        (detection.landmark,),
        detection.range_eq2_m if is_paper else detection.range_m,
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
    """Localize a robot along a run.

    Args:
        odometry: readings, from the known start.
        observations: observations of each step; those of the first step are unused, as the start is
            known.
        landmarks: map of the landmarks.
        parameters: parameters of the filter.
        camera_m: x and y of the effective viewpoint in the base frame.
        covariance: (3, 3) covariance of the start; None: from the parameters.

    Raises:
        LocalizationError: invalid readings or observations.
    """
    times = odometry.times_s
    robot = LocalizationFilter(
        landmarks, parameters, camera_m, float(times[0]), odometry.start, covariance
    )
    estimates = [robot.estimate]
    for k in range(1, len(observations)):
        time_s = float(times[k])
        speed = float(odometry.distances_m[k - 1]) / (time_s - estimates[-1].time_s)
        turn = float(odometry.turns_rad[k - 1])
        estimates.append(robot.step(time_s, speed, turn, observations[k]))
    return Track(tuple(estimates), odometry.planar_poses[: len(observations)])
