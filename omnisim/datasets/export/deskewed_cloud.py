"""Point clouds without the skew of a moving lidar, as in data sets of vehicles."""

from __future__ import annotations

import numpy as np
import scipy  # its submodules load when first used
from numpy.typing import NDArray

from omnisim.core.poses import inverse
from omnisim.core.trajectories import Trajectory
from omnisim.datasets.export.stored_clouds import StoredCloud


def deskewed_points_m(
    cloud: StoredCloud, truth: Trajectory, base_from_lidar: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Points (n, 3) in the lidar's frame at the revolution's end, as if all were measured then.

    Assumes straight, uniform motion between successive poses: the pose at the revolution's start,
    the true poses during the revolution, and the pose at its end.

    Args:
        cloud: point cloud of a revolution.
        truth: true poses of the base.
        base_from_lidar: (4, 4) pose of the lidar on the base.

    Raises:
        RunError: the header lacks poses or times.
    """
    header = cloud.header
    end_s = header.number("time_s")
    start_s = end_s - 1.0 / header.number("rate_hz")
    within = (truth.times_s > start_s) & (truth.times_s < end_s)
    lidar_from_world = inverse(header.pose("world_from_lidar"))
    knots_s = np.concatenate(([start_s], truth.times_s[within], [end_s])) - start_s
    knots = lidar_from_world @ np.stack(
        [
            header.pose("world_from_lidar_at_start"),
            *(truth.world_from_base[within] @ base_from_lidar),
            header.pose("world_from_lidar"),
        ]
    )
    times_s = cloud.points["time"].astype(np.float64)
    rotations = scipy.spatial.transform.Rotation.from_matrix(knots[:, :3, :3])
    turned = scipy.spatial.transform.Slerp(knots_s, rotations)(np.clip(times_s, 0.0, knots_s[-1]))
    shifts = [np.interp(times_s, knots_s, knots[:, axis, 3]) for axis in range(3)]
    points_m: NDArray[np.float64] = turned.apply(cloud.points_m) + np.stack(shifts, axis=-1)
    return points_m
