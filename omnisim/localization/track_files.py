"""A track as files: a trajectory, the same with covariances, and what became of each sighting."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from omnisim.atomic_file import atomic_write
from omnisim.localization.track import Track
from omnisim.robot import Trajectory, write_trajectory

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
    """Write `estimate.tum`, `estimate.csv` and `measurements.csv` into a folder that is there.

    Raises:
        OutputError: they cannot be written.
    """
    poses = track.poses
    trajectory = Trajectory.on_ground(track.times_s, poses[:, :2], poses[:, 2])
    write_trajectory(folder / ESTIMATE_TUM, trajectory)
    upper = np.triu_indices(3)
    accepted, rejected = track.counts(True), track.counts(False)
    lines = [_ESTIMATE_COLUMNS]
    for k, estimate in enumerate(track.estimates):
        numbers = (estimate.time_s, *estimate.pose, *estimate.covariance[upper])
        told = [f"{number:.12g}" for number in numbers]
        nis = f"{estimate.nis:.6g}" if math.isfinite(estimate.nis) else ""
        told += [str(accepted[k]), str(rejected[k]), nis, str(estimate.nis_degrees)]
        lines.append(",".join(told))
    _write(folder / ESTIMATE_CSV, lines)
    lines = [_MEASUREMENT_COLUMNS]
    for step, estimate in enumerate(track.estimates):
        for judged in estimate.judgements:
            numbers = (
                judged.range_m,
                judged.bearing_rad,
                judged.range_innovation_m,
                judged.bearing_innovation_rad,
                judged.distance_squared,
            )
            told = [str(step), f"{estimate.time_s:.9f}", judged.landmark]
            told += [f"{number:.6f}" for number in numbers]
            lines.append(",".join((*told, judged.verdict)))
    _write(folder / MEASUREMENTS, lines)


def _write(path: Path, lines: list[str]) -> None:
    with atomic_write(path) as partial:
        partial.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")
