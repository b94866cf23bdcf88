"""Inertial measurement units: angular rate and specific force.

A reading is the mean over one period centered on its time, in the frame of the unit (REP 103). This
matches a MEMS unit that integrates and corrects its stamps for the delay. The sum of the readings
is the change of velocity and heading, even if acceleration jumps, and the trapezoidal rule
recovers the motion. White noise and a random-walk bias are added, as in Kalibr's model and in
visual-inertial data sets:

    rate = true rate + bias + density·√rate_hz·n        bias += random walk/√rate_hz·n

The first reading averages only the time after the start, the last only the time before the end. The
model omits scale errors, misalignment, saturation, rounding, temperature and the earth's rotation.

Noise and bias depend only on the drive's seed, the sensor's name and the index of the reading. One
file per run holds all readings.

Sources: Furgale et al., "Unified temporal and spatial calibration for multi-sensor systems", IROS
2013; IEEE Std 952-1997 (Allan variance); Burri et al., "The EuRoC micro aerial vehicle datasets",
IJRR 2016; Schubert et al., "The TUM VI benchmark", IROS 2018.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np
import scipy  # its submodules load when first used

from omnisim.core.arrays import Floats, Ints
from omnisim.core.errors import RunError
from omnisim.core.files.atomic_file import is_written
from omnisim.core.files.number_files import BLOCK, write_table
from omnisim.core.files.parameters import Level, Parameters, overriding
from omnisim.core.poses import rotation_angles
from omnisim.core.random_numbers import key_of, normal, pcg4d
from omnisim.core.trajectories import Trajectory
from omnisim.core.trajectories.body_motion import BodyMotion
from omnisim.rendering.sensor import TABLE_SUFFIX, Mount, SensorSettings
from omnisim.sensors.sensor_table import Rate, SensorTable

STANDARD_GRAVITY_MPS2 = 9.80665
PARAMETERS = "sensor.yaml"
READINGS, BIASES = "readings.csv", "biases.csv"
COLUMNS = "t_s,wx_radps,wy_radps,wz_radps,fx_mps2,fy_mps2,fz_mps2"
BIAS_COLUMNS = COLUMNS.replace(",w", ",bias_w").replace(",f", ",bias_f")
MAX_TURN_DEG = 120.0  # between poses: near a half turn a smooth motion is ambiguous
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

    def biases(
        self, count: int, rate_hz: float, key: int, begin: int = 0, before: Floats | float = 0.0
    ) -> Floats:
        """Biases (count, 6) of readings: three rates, then three forces.

        The first reading has the index `begin`; `before` are the biases (6,) of the one before it.
        """
        walk = self._six(
            self.gyro_bias_walk_radps2_per_sqrt_hz, self.accel_bias_walk_mps3_per_sqrt_hz
        )
        start = self._six(self.gyro_bias_sigma_radps, self.accel_bias_sigma_mps2)
        biases = np.empty((count, 6))
        for first in range(0, count, _BLOCK):
            indices = np.arange(first, min(first + _BLOCK, count))
            normal = _numbers(begin + indices, _READING, key)[1]
            biases[indices] = walk / math.sqrt(rate_hz) * normal
        if begin == 0:
            biases[0] = start * _numbers(np.arange(1), _START, key)[0][0]
        else:
            biases[0] += before
        return np.cumsum(biases, axis=0, out=biases)

    def noise(self, indices: Ints, rate_hz: float, key: int) -> Floats:
        """White noise (n, 6) of readings by their indices (n,): three rates, then three forces."""
        density = self._six(self.gyro_noise_radps_per_sqrt_hz, self.accel_noise_mps2_per_sqrt_hz)
        return density * math.sqrt(rate_hz) * _numbers(indices, _READING, key)[0]

    @staticmethod
    def _six(gyro: float, accel: float) -> Floats:
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
    motion: BodyMotion, base_from_imu: Floats, gravity_mps2: float, times_s: Floats, period_s: float
) -> Floats:
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
    states = motion.at(np.concatenate((begin, end))).at_mount(base_from_imu)
    duration_s = (end - begin)[:, None]
    rotation = scipy.spatial.transform.Rotation
    first, last = np.split(states.world_from_base[:, :3, :3], 2)
    before_mps, after_mps = np.split(states.velocity_mps, 2)
    turns = rotation.from_matrix(np.swapaxes(first, 1, 2) @ last).as_rotvec()
    halfway = first @ rotation.from_rotvec(0.5 * turns).as_matrix()
    upward = (after_mps - before_mps) / duration_s + (0.0, 0.0, gravity_mps2)
    forces = np.einsum("nij,ni->nj", halfway, upward)
    return np.concatenate((turns / duration_s, forces), axis=1)


def _numbers(indices: Ints, stream: int, key: int) -> Floats:
    """Two sets of standard normal numbers (2, n, 6), per reading (n,) and axis."""
    hashes = pcg4d(indices[:, None], np.arange(6), stream, key)
    return np.stack((normal(hashes[0], hashes[1]), normal(hashes[2], hashes[3]))).astype(np.float64)


@dataclass(frozen=True, repr=False)
class Imu(SensorSettings):
    """Inertial measurement unit."""

    errors: ImuErrors  # noise and biases
    rate_hz: float = 200.0  # readings per second, which are averages over a period
    gravity_mps2: float = STANDARD_GRAVITY_MPS2  # gravity along the world's −z

    noun: ClassVar[str] = "IMU"
    suffixes: ClassVar[tuple[str, ...]] = (TABLE_SUFFIX,)
    document_names: ClassVar[tuple[str, ...]] = (PARAMETERS, READINGS, BIASES)

    @property
    def near_m(self) -> float:
        """Infinite: the unit does not see and may be inside the body."""
        return math.inf

    def summary(self) -> str:
        """Short description: rate and gravity."""
        return f"{self.rate_hz:g} Hz, gravity {self.gravity_mps2:g} m/s²"

    def documents(self, mount: Mount[object]) -> dict[str, str]:
        """Mount, rate and noise, with the keys of EuRoC's sensor.yaml; its body is the base."""
        errors = self.errors
        numbers = {
            "rate_hz": self.rate_hz,
            "gyroscope_noise_density": errors.gyro_noise_radps_per_sqrt_hz,
            "gyroscope_random_walk": errors.gyro_bias_walk_radps2_per_sqrt_hz,
            "accelerometer_noise_density": errors.accel_noise_mps2_per_sqrt_hz,
            "accelerometer_random_walk": errors.accel_bias_walk_mps3_per_sqrt_hz,
            "gravity_mps2": self.gravity_mps2,
        }
        pose = ", ".join(map(_yaml_number, mount.base_from_sensor.ravel()))
        lines = ("sensor_type: imu", "T_BS:", "  cols: 4", "  rows: 4", f"  data: [{pose}]")
        rest = (f"{key}: {_yaml_number(number)}" for key, number in numbers.items())
        return {PARAMETERS: "\n".join((*lines, *rest)) + "\n"}

    def check_trajectory(self, mount: Mount[object], truth: Trajectory, times_s: Floats) -> None:
        """Raise an error if the turn between two poses is too wide.

        Raises:
            RunError: a turn is too wide; names sensor, step, turn and limit.
        """
        rotations = truth.world_from_base[:, :3, :3]
        turns_deg = np.abs(np.degrees(rotation_angles(rotations[:-1], rotations[1:])))
        if np.any(turns_deg > MAX_TURN_DEG):
            step = int(np.argmax(turns_deg))
            raise RunError(
                f"sensor {mount.name!r}: step {step} → {step + 1}: expected a turn of at most "
                f"{MAX_TURN_DEG:g}°, got {turns_deg[step]:.4g}°"
            )

    @classmethod
    def suffixes_of(cls, manifest: Mapping[str, Any]) -> tuple[str, ...]:
        """No suffixes: one file holds all readings. Runs of older versions have a file per step."""
        return () if "readings" in manifest else cls.suffixes

    def manifest(self, mount: Mount[object]) -> dict[str, Any]:
        """Setting with the name of the readings' file."""
        return {"readings": READINGS}

    def write_readings(
        self, folder: Path, mount: Mount[object], motion: BodyMotion, seed: int, times_s: Floats
    ) -> None:
        """Write the files of all readings and of their biases, unless they exist.

        Raises:
            OutputError: a file cannot be written.
        """
        key = key_of("imu", seed, mount.name)
        biases = self.errors.biases(len(times_s), self.rate_hz, key)
        parts = [slice(first, first + BLOCK) for first in range(0, len(times_s), BLOCK)]
        if not is_written(folder / READINGS):
            blocks = (
                self._block(mount, motion, times_s[part], biases[part], key, part.start)
                for part in parts
            )
            write_table(folder / READINGS, COLUMNS, blocks)
        if not is_written(folder / BIASES):
            blocks = (np.column_stack((times_s[part], biases[part])) for part in parts)
            write_table(folder / BIASES, BIAS_COLUMNS, blocks)

    def readings(
        self, mount: Mount[object], motion: BodyMotion, seed: int, times_s: Floats
    ) -> Floats:
        """Readings (n, 6) at times (n,): angular rates in rad/s, then specific forces in m/s²."""
        key = key_of("imu", seed, mount.name)
        biases = self.errors.biases(len(times_s), self.rate_hz, key)
        return self._block(mount, motion, times_s, biases, key, 0)[:, 1:]

    def next_errors(
        self, mount: Mount[object], seed: int, first: int, count: int, before: Floats
    ) -> tuple[Floats, Floats]:
        """Biases and noise (count, 6) of readings from index `first` on, see `readings_at`.

        `before` are the biases (6,) of the reading before them.
        """
        key = key_of("imu", seed, mount.name)
        biases = self.errors.biases(count, self.rate_hz, key, first, before)
        return biases, self.errors.noise(first + np.arange(count), self.rate_hz, key)

    def readings_at(
        self,
        mount: Mount[object],
        motion: BodyMotion,
        times_s: Floats,
        biases: Floats,
        noise: Floats,
    ) -> Floats:
        """Readings (n, 6) at times (n,), with these errors (n, 6)."""
        period_s = 1.0 / self.rate_hz
        ideal = true_readings(motion, mount.base_from_sensor, self.gravity_mps2, times_s, period_s)
        return ideal + biases + noise

    def _block(
        self,
        mount: Mount[object],
        motion: BodyMotion,
        times_s: Floats,
        biases: Floats,
        key: int,
        first: int,
    ) -> Floats:
        """Rows (n, 7) of readings at times (n,), times first; `first` is the first's index."""
        noise = self.errors.noise(first + np.arange(len(times_s)), self.rate_hz, key)
        return np.column_stack((times_s, self.readings_at(mount, motion, times_s, biases, noise)))


def _yaml_number(number: float) -> str:
    """Format a number as a YAML 1.1 float, which needs a point even before an exponent."""
    return np.format_float_scientific(number, trim="0")


@overriding(ImuErrors)
class ImuTable(SensorTable):
    """Inertial measurement unit that measures angular rate and specific force at its own rate."""

    sensor_class: ClassVar[type[SensorSettings]] = Imu

    type: Literal["imu"]
    device: Literal["adis16448", "bmi160", "ideal"] = "adis16448"
    """Device that sets the noise: "adis16448" as in EuRoC, "bmi160" as in TUM VI, or "ideal"."""
    rate_hz: Rate | None = 200.0
    """Readings per second, from the start of the drive."""
    gravity_mps2: Level = STANDARD_GRAVITY_MPS2
    """Gravity along the world's −z; at rest and level, the specific force along z equals it."""

    def sensor(self) -> Imu:
        """Build the unit; all axes share its errors."""
        errors = self.overriding(DEVICES[self.device])
        return Imu(errors, self.rate_hz or 200.0, self.gravity_mps2)
