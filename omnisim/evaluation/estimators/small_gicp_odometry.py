"""Lidar odometry by small_gicp: each revolution against a map of voxels.

Source: Koide, "small_gicp: efficient and parallel algorithms for point cloud registration", JOSS
2024; package `small-gicp`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import scipy
from numpy.typing import NDArray

from omnisim.core.poses import inverse, nearest_rotation, pose_from_rotation
from omnisim.core.trajectories import Trajectory
from omnisim.datasets.export.recording import Recording
from omnisim.evaluation.estimator import Estimator
from omnisim.evaluation.estimators.lidar_sweeps import LidarSweep, LidarSweeps

SAMPLING_M, VOXEL_M = 0.2, 0.5
MAX_DISTANCE_M = 1.0  # between corresponding points
NEIGHBORS = 10  # nearest points for a covariance
Floats = NDArray[np.float64]


class SmallGicpOdometry(Estimator):
    """Distribution-to-distribution ICP, with motion compensation by constant velocity."""

    title = "small_gicp (lidar)"
    package, module = "small-gicp", "small_gicp"

    def estimate(self, run: Recording, work: Path) -> Trajectory:
        """Poses of the base at the ends of the revolutions."""
        import small_gicp

        sweeps, voxels = LidarSweeps(run), small_gicp.GaussianVoxelMap(VOXEL_M)
        pose, motion = np.eye(4), np.eye(4)
        poses: list[Floats] = []
        for sweep in sweeps:
            cloud, _ = small_gicp.preprocess_points(
                compensated(sweep, motion), SAMPLING_M, NEIGHBORS, 1
            )
            if poses:
                result = small_gicp.align(
                    voxels, cloud, pose @ motion, max_correspondence_distance=MAX_DISTANCE_M,
                    num_threads=1,
                )  # fmt: skip
                before, pose = pose, _without_rounding(result.T_target_source)
                motion = inverse(before) @ pose
            voxels.insert(cloud, pose)
            poses.append(pose)
        return sweeps.trajectory(poses)


def _without_rounding(pose: Floats) -> Floats:
    """Pose (4, 4) with its rotation made orthonormal, against accumulated rounding errors."""
    return pose_from_rotation(nearest_rotation(pose[:3, :3]), pose[:3, 3])


def compensated(sweep: LidarSweep, motion: Floats) -> Floats:
    """Points (n, 3) in the lidar's frame at the end of the revolution.

    Args:
        sweep: revolution.
        motion: (4, 4) pose of the lidar at the end in its frame at the start; velocity is constant.
    """
    back = inverse(motion)
    turn = scipy.spatial.transform.Rotation.from_matrix(back[:3, :3]).as_rotvec()
    left = (1.0 - sweep.share)[:, None]  # remaining share of the motion
    rotated = scipy.spatial.transform.Rotation.from_rotvec(left * turn).apply(sweep.points_m)
    return rotated + left * back[:3, 3]
