"""Dead reckoning by the wheels, and by an IMU."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import scipy

from omnisim.core.arrays import Floats
from omnisim.core.errors import EstimatorError
from omnisim.core.poses import inverse, pose_from_rotation
from omnisim.core.trajectories import Trajectory
from omnisim.datasets.export.recording import ImuReadings, Recording
from omnisim.evaluation.estimator import Estimator
from omnisim.sensors.imu.imu import STANDARD_GRAVITY_MPS2, Imu


class WheelOdometry(Estimator):
    """Dead reckoning by the recorded wheel readings, from the true start."""

    title = "wheel odometry"
    alignment = "none"
    is_level = True

    def estimate(self, run: Recording, work: Path) -> Trajectory:
        """Poses of the base at the steps."""
        if run.odometry is None:
            raise EstimatorError("the run has no wheels")
        return run.odometry.dead_reckoned()


# Integration of an IMU's readings, from the true state at the first of them.


class ImuIntegration(Estimator):
    """Integration of angular rates (once) and specific forces (twice), from the true start."""

    title = "integrated IMU"
    alignment = "none"
    is_level = True

    def estimate(self, run: Recording, work: Path) -> Trajectory:
        """Poses of the base at the readings."""
        names = run.sensors(Imu)
        if not names:
            raise EstimatorError("the run has no IMU")
        base_from_imu = run.base_from_imu(names[0])
        readings = run.imu_readings(names[0])
        settings = run.run.manifest.sensors[names[0]].model_extra or {}
        start = run.start_state(names[0], float(readings.times_s[0])).at_mount(base_from_imu)
        gravity_mps2 = float(settings.get("gravity_mps2", STANDARD_GRAVITY_MPS2))
        first = start.world_from_base[0], start.velocity_mps[0]
        world_from_imu = integrate(readings, *first, gravity_mps2)
        return Trajectory(readings.times_s, world_from_imu @ inverse(base_from_imu))


def integrate(
    readings: ImuReadings, world_from_imu: Floats, velocity_mps: Floats, gravity_mps2: float
) -> Floats:
    """Poses (n, 4, 4) of an IMU at its readings, from pose (4, 4) and velocity (3,) at the first.

    A reading is the mean over the period centered at its time. Each step between two times
    therefore uses half a period of either reading. Gravity is along the world's −z.
    """
    halves_s = 0.5 * np.diff(readings.times_s)
    poses = [np.array(world_from_imu, dtype=np.float64)]
    rotation, position = poses[0][:3, :3].copy(), poses[0][:3, 3].copy()
    velocity = np.array(velocity_mps, dtype=np.float64)
    down = np.array((0.0, 0.0, -gravity_mps2))
    rates = readings.values[:, :3]
    vectors = [0.5 * halves_s[:, None] * part for part in (rates[:-1], rates[1:])]
    quarter_turns = [
        scipy.spatial.transform.Rotation.from_rotvec(vector).as_matrix() for vector in vectors
    ]
    for index, half_s in enumerate(halves_s):
        for reading, turns in zip((index, index + 1), quarter_turns, strict=True):
            middle = rotation @ turns[index]
            acceleration = middle @ readings.values[reading, 3:] + down
            position = position + half_s * velocity + 0.5 * half_s**2 * acceleration
            velocity = velocity + half_s * acceleration
            rotation = middle @ turns[index]
        poses.append(pose_from_rotation(rotation, position))
    return np.stack(poses)
