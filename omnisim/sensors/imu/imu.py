"""Inertial measurement units: angular rate and specific force.

A reading is the mean over one period centered on its time, in the frame of the unit (REP 103). This
matches a MEMS unit that integrates and corrects its stamps for the delay. The sum of the readings
is the change of velocity and heading, even if acceleration jumps, and the trapezoidal rule
recovers the motion. White noise and a random-walk bias are added, as in Kalibr's model and in
visual-inertial data sets:

    rate = true rate + bias + density·√rate_hz·n        bias += random walk/√rate_hz·n

The first reading averages only the time after the start, the last only the time before the end. The
model omits scale errors, misalignment, saturation, rounding, temperature and the earth's rotation.

Noise and bias depend only on a key and the index of the reading.

Sources: Furgale et al., "Unified temporal and spatial calibration for multi-sensor systems", IROS
2013; IEEE Std 952-1997 (Allan variance); Burri et al., "The EuRoC micro aerial vehicle datasets",
IJRR 2016; Schubert et al., "The TUM VI benchmark", IROS 2018.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy  # its submodules load when first used
from numpy.typing import NDArray

from omnisim.core.files.parameters import Level, Parameters
from omnisim.core.random_numbers import normal, pcg4d
from omnisim.core.trajectories.body_motion import BodyMotion

STANDARD_GRAVITY_MPS2 = 9.80665
_READING, _START = 0, 1  # streams of random numbers
_BLOCK = 100_000  # readings per block, which bounds memory


@dataclass(frozen=True)
class ImuErrors(Parameters, name="imu", in_radians=True):
    """Noise and bias of an inertial measurement unit, in radians also in files, as Kalibr's."""

    gyro_noise_radps_per_sqrt_hz: Level = 0.0
    """Density of the angular rate's white noise, rad/s/√Hz. Default: the device's."""
    gyro_bias_walk_radps2_per_sqrt_hz: Level = 0.0
    """Random walk of the angular rate's bias, rad/s²/√Hz. Default: the device's."""
    accel_noise_mps2_per_sqrt_hz: Level = 0.0
    """Density of the specific force's white noise, m/s²/√Hz. Default: the device's."""
    accel_bias_walk_mps3_per_sqrt_hz: Level = 0.0
    """Random walk of the specific force's bias, m/s³/√Hz. Default: the device's."""
    gyro_bias_sigma_radps: Level = 0.0
    """Standard deviation of the angular rate's initial bias, rad/s. Default: 0."""
    accel_bias_sigma_mps2: Level = 0.0
    """Standard deviation of the specific force's initial bias, m/s². Default: 0."""

    def biases(self, count: int, rate_hz: float, key: int) -> NDArray[np.float64]:
        """Biases (count, 6) of the first `count` readings: three rates, then three forces.

        Args:
            count: number of readings.
            rate_hz: readings per second.
            key: key of the random numbers.
        """
        walk = self._six(
            self.gyro_bias_walk_radps2_per_sqrt_hz, self.accel_bias_walk_mps3_per_sqrt_hz
        )
        start = self._six(self.gyro_bias_sigma_radps, self.accel_bias_sigma_mps2)
        biases = np.empty((count, 6))
        for first in range(0, count, _BLOCK):
            indices = np.arange(first, min(first + _BLOCK, count))
            biases[indices] = walk / math.sqrt(rate_hz) * _numbers(indices, _READING, key)[1]
        biases[0] = start * _numbers(np.arange(1), _START, key)[0][0]
        return np.cumsum(biases, axis=0, out=biases)

    def noise(self, indices: NDArray[np.int64], rate_hz: float, key: int) -> NDArray[np.float64]:
        """White noise (n, 6) of readings (n,): three rates, then three forces.

        Args:
            indices: (n,) indices of the readings.
            rate_hz: readings per second.
            key: key of the random numbers.
        """
        density = self._six(self.gyro_noise_radps_per_sqrt_hz, self.accel_noise_mps2_per_sqrt_hz)
        return density * math.sqrt(rate_hz) * _numbers(indices, _READING, key)[0]

    @staticmethod
    def _six(gyro: float, accel: float) -> NDArray[np.float64]:
        return np.repeat((gyro, accel), 3)


# From the Allan variance of recordings at rest, as published with the data sets.
DEVICES = {
    # EuRoC MAV: sensor.yaml of imu0
    "adis16448": ImuErrors(1.6968e-4, 1.9393e-5, 2.0e-3, 3.0e-3),
    # TUM VI: values read from its Allan plots, not the inflated ones
    "bmi160": ImuErrors(8.0e-5, 2.2e-6, 1.4e-3, 8.6e-5),
    "ideal": ImuErrors(),
}


def true_readings(
    motion: BodyMotion,
    base_from_imu: NDArray[np.float64],
    gravity_mps2: float,
    times_s: NDArray[np.float64],
    period_s: float,
) -> NDArray[np.float64]:
    """Error-free angular rate and specific force (n, 6) at times (n,), in the unit's frame.

    Args:
        motion: motion of the base.
        base_from_imu: (4, 4) pose of the unit; off the base's origin, turns cause accelerations.
        gravity_mps2: gravity along the world's −z.
        times_s: (n,) times of the readings.
        period_s: averaging time of a reading, cut off at the start and the end of the motion.
    """
    begin, end = times_s - 0.5 * period_s, times_s + 0.5 * period_s
    if motion.end_s > motion.start_s:
        begin, end = np.maximum(begin, motion.start_s), np.minimum(end, motion.end_s)
    before, after = (motion.at(times).at_mount(base_from_imu) for times in (begin, end))
    duration_s = (end - begin)[:, None]
    rotation = scipy.spatial.transform.Rotation
    first, last = (one.world_from_base[:, :3, :3] for one in (before, after))
    turns = rotation.from_matrix(np.swapaxes(first, 1, 2) @ last).as_rotvec()
    halfway = first @ rotation.from_rotvec(0.5 * turns).as_matrix()
    upward = (after.velocity_mps - before.velocity_mps) / duration_s + (0.0, 0.0, gravity_mps2)
    forces = np.einsum("nij,ni->nj", halfway, upward)
    return np.concatenate((turns / duration_s, forces), axis=1)


def _numbers(indices: NDArray[np.int64], stream: int, key: int) -> NDArray[np.float64]:
    """Two sets of standard normal numbers (2, n, 6), per reading (n,) and axis."""
    hashes = pcg4d(indices[:, None], np.arange(6), stream, key)
    return np.stack((normal(hashes[0], hashes[1]), normal(hashes[2], hashes[3]))).astype(np.float64)
