"""Files of a track: a trajectory, a table with covariances, and the data associations."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from omnisim.core.files.atomic_file import write_text
from omnisim.core.trajectories import Trajectory, write_trajectory
from omnisim.perception.localization.track import Track

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
            numbers = (
                association.range_m,
                association.bearing_rad,
                association.range_innovation_m,
                association.bearing_innovation_rad,
                association.distance_squared,
            )
            cells = [str(step), f"{estimate.time_s:.9f}", association.landmark]
            cells += [f"{number:.6f}" for number in numbers]
            lines.append(",".join((*cells, association.verdict)))
    write_text(folder / MEASUREMENTS, "\n".join(lines) + "\n")
