"""Lidar odometry by KISS-ICP and small_gicp: each revolution against a map of voxels.

Sources: Vizzo et al., "KISS-ICP: in defense of point-to-point ICP", RA-L 2023, package `kiss-icp`;
Koide, "small_gicp: efficient and parallel algorithms for point cloud registration", JOSS 2024,
package `small-gicp`.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import scipy

from omnisim.core.arrays import Floats
from omnisim.core.errors import EstimatorError
from omnisim.core.poses import inverse, nearest_rotation, pose_from_rotation
from omnisim.core.trajectories import Trajectory
from omnisim.datasets.export.recording import Recording
from omnisim.evaluation.estimator import Estimator
from omnisim.sensors.lidar.spinning_lidar import SpinningLidar

VOXEL_M = 0.5  # for rooms and yards; the package's default of 1 m is for streets
MAX_RANGE_M = 40.0  # sparse far points, such as those behind windows, bias the registration
SAMPLING_M = 0.2
MAX_DISTANCE_M = 1.0  # between corresponding points
NEIGHBORS = 10  # nearest points for a covariance


class KissIcpOdometry(Estimator):
    """Point-to-point ICP against a local map, with motion compensation by constant velocity."""

    title = "KISS-ICP (lidar)"
    package, module = "kiss-icp", "kiss_icp"
    min_path_m = 10.0  # errors: 1.4 % over 5.4 m of soccer, 0.16 % over its whole lap
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
                config.registration.max_num_threads = 1  # more would sum in varying order
                odometry = KissICP(config)
            odometry.register_frame(sweep.points_m, sweep.share)
            poses.append(np.array(odometry.last_pose))
        return sweeps.trajectory(poses)


class SkewedKissIcpOdometry(KissIcpOdometry):
    """KISS-ICP without motion compensation, which shows the error due to skew."""

    title = "KISS-ICP, skew left in (lidar)"
    is_compensated = False


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
            points_m = compensated(sweep, motion)
            cloud, _ = small_gicp.preprocess_points(points_m, SAMPLING_M, NEIGHBORS, 1)
            if poses:
                result = small_gicp.align(
                    voxels, cloud, pose @ motion, max_correspondence_distance=MAX_DISTANCE_M,
                    num_threads=1,
                )  # fmt: skip
                before, found = pose, result.T_target_source
                # without accumulated rounding errors
                pose = pose_from_rotation(nearest_rotation(found[:3, :3]), found[:3, 3])
                motion = inverse(before) @ pose
            voxels.insert(cloud, pose)
            poses.append(pose)
        return sweeps.trajectory(poses)


def compensated(sweep: LidarSweep, motion: Floats) -> Floats:
    """Points (n, 3) of a revolution in the lidar's frame at its end.

    `motion` is the (4, 4) pose of the lidar at the end in its frame at the start, at constant
    velocity.
    """
    back = inverse(motion)
    turn = scipy.spatial.transform.Rotation.from_matrix(back[:3, :3]).as_rotvec()
    left = (1.0 - sweep.share)[:, None]  # remaining share of the motion
    rotated = scipy.spatial.transform.Rotation.from_rotvec(left * turn).apply(sweep.points_m)
    return rotated + left * back[:3, 3]


class LidarSweep(NamedTuple):
    """Revolution of a lidar."""

    points_m: Floats  # (n, 3) points, each in the lidar's frame at the point's own time
    share: Floats  # (n,) time of each point, from 0 at the start of the revolution to 1 at its end
    # range_min_m, range_max_m: range limits of the lidar
    range_min_m: float
    range_max_m: float


class LidarSweeps:
    """Revolutions of a run's first lidar.

    Raises:
        EstimatorError: the run has no lidar, or fewer than three revolutions.
    """

    def __init__(self, run: Recording):
        names = run.sensors(SpinningLidar)
        if not names:
            raise EstimatorError("the run has no lidar")
        self._run, self._name = run, names[0]
        self.times_s = run.times_s(self._name)
        if len(self.times_s) < 3:
            raise EstimatorError(f"{len(self.times_s)} revolutions: expected at least 3")

    def __iter__(self) -> Iterator[LidarSweep]:
        for index in range(len(self.times_s)):
            cloud = self._run.cloud(self._name, index)
            header = cloud.header
            share = cloud.points["time"].astype(np.float64) * header.number("rate_hz")
            limits = header.number("range_min_m"), header.number("range_max_m")
            yield LidarSweep(cloud.points_m, np.clip(share, 0.0, 1.0), *limits)

    def trajectory(self, world_from_lidar: list[Floats]) -> Trajectory:
        """Trajectory of the base, from the lidar's poses at the ends of the revolutions."""
        lidar_from_base = inverse(self._run.base_from_lidar(self._name))
        return Trajectory(self.times_s, np.stack(world_from_lidar) @ lidar_from_base)
