"""Lidar odometry by KISS-ICP.

Source: Vizzo et al., "KISS-ICP: in defense of point-to-point ICP", RA-L 2023; package `kiss-icp`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from omnisim.core.trajectories import Trajectory
from omnisim.datasets.export.recording import Recording
from omnisim.evaluation.estimator import Estimator
from omnisim.evaluation.estimators.lidar_sweeps import LidarSweeps

VOXEL_M = 0.5  # for rooms and yards; the package's default of 1 m is for streets
MAX_RANGE_M = 40.0  # sparse far points, such as those behind windows, bias the registration


class KissIcpOdometry(Estimator):
    """Point-to-point ICP against a local map, with motion compensation by constant velocity."""

    title = "KISS-ICP (lidar)"
    package, module = "kiss-icp", "kiss_icp"
    min_path_m = 10.0  # over 5.4 m of soccer 1.4 %, over the whole lap 0.16 %
    is_compensated = True

    def estimate(self, run: Recording, work: Path) -> Trajectory:
        """Poses of the base at the ends of the revolutions."""
        from kiss_icp.config import KISSConfig
        from kiss_icp.kiss_icp import KissICP

        sweeps = LidarSweeps(run)
        odometry = None
        poses = []
        for sweep in sweeps:
            if odometry is None:
                config = KISSConfig()
                config.data.deskew = self.is_compensated
                config.data.min_range = sweep.range_min_m
                config.data.max_range = min(sweep.range_max_m, MAX_RANGE_M)
                config.mapping.voxel_size = VOXEL_M
                config.registration.max_num_threads = 1  # more threads would sum in any order
                odometry = KissICP(config)
            odometry.register_frame(sweep.points_m, sweep.share)
            poses.append(np.array(odometry.last_pose))
        return sweeps.trajectory(poses)


class SkewedKissIcpOdometry(KissIcpOdometry):
    """KISS-ICP without motion compensation, which shows the error due to skew."""

    title = "KISS-ICP, skew left in (lidar)"
    is_compensated = False
