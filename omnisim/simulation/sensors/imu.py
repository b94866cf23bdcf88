"""Inertial measurement units on vehicles: angular rate and specific force.

A reading is the motion at its time, in the frame of the unit (REP 103), with white noise and a bias
that walks at random, as in Kalibr's model and in data sets for visual-inertial odometry:

    rate = true rate + bias + density·√rate_hz·n        bias += random walk/√rate_hz·n

The motion is the smooth one through the poses of the drive, see `SmoothMotion`: rates and forces do
not jump where a pose follows another. Not in the model: scale errors, misalignment, saturation,
rounding, temperature and the earth's rotation.

Noise and bias follow from the drive's seed, the sensor's name and the number of the reading.

Sources: Furgale et al., "Unified temporal and spatial calibration for multi-sensor systems", IROS
2013; IEEE Std 952-1997 (Allan variance); Burri et al., "The EuRoC micro aerial vehicle datasets",
IJRR 2016; Schubert et al., "The TUM VI benchmark", IROS 2018.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from omnisim.atomic_file import write_text
from omnisim.errors import RunError
from omnisim.parameters import Number
from omnisim.poses import rotation_angles
from omnisim.sensors.degradations.random_numbers import key_of, normal, pcg4d
from omnisim.sensors.stage import Stage
from omnisim.simulation.is_written import is_written
from omnisim.simulation.sensors.mount import Level, SensorMount
from omnisim.simulation.sensors.sensor import (
    DriveSettings,
    Instrument,
    Measurement,
    Moment,
    MountedSensor,
)
from omnisim.trajectories import Trajectory
from omnisim.trajectories.smooth_motion import SmoothMotion

READINGS_SUFFIX, PARAMETERS = ".csv", "sensor.yaml"
COLUMNS = "t_s,wx_radps,wy_radps,wz_radps,fx_mps2,fy_mps2,fz_mps2"
STANDARD_GRAVITY_MPS2 = 9.80665
MAX_READINGS = 10_000_000  # half a gigabyte; 14 hours at 200 Hz
MAX_TURN_DEG = 120.0  # from pose to pose: near half a turn no smooth motion is found
LATE = 1e-3  # of the time between readings: printed times are rounded
_READING, _START = 0, 1  # streams of random numbers
_BLOCK = 100_000  # readings at a time, which bounds memory


@dataclass(frozen=True)
class ImuErrors:
    """Noise of an inertial measurement unit.

    Attributes:
        gyro_noise_radps_per_sqrt_hz, accel_noise_mps2_per_sqrt_hz: densities of white noise.
        gyro_bias_walk_radps2_per_sqrt_hz, accel_bias_walk_mps3_per_sqrt_hz: random walks of the
            biases.
        gyro_bias_sigma_radps, accel_bias_sigma_mps2: standard deviations of the biases at the
            start.
    """

    gyro_noise_radps_per_sqrt_hz: float = 0.0
    gyro_bias_walk_radps2_per_sqrt_hz: float = 0.0
    accel_noise_mps2_per_sqrt_hz: float = 0.0
    accel_bias_walk_mps3_per_sqrt_hz: float = 0.0
    gyro_bias_sigma_radps: float = 0.0
    accel_bias_sigma_mps2: float = 0.0

    def biases(self, count: int, rate_hz: float, key: int) -> NDArray[np.float64]:
        """Biases (count, 6) of the first readings: of three rates, then of three forces."""
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
        """White noise (n, 6) of readings (n,): of three rates, then of three forces."""
        density = self._six(self.gyro_noise_radps_per_sqrt_hz, self.accel_noise_mps2_per_sqrt_hz)
        noise: NDArray[np.float64] = (
            density * math.sqrt(rate_hz) * _numbers(indices, _READING, key)[0]
        )
        return noise

    @staticmethod
    def _six(gyro: float, accel: float) -> NDArray[np.float64]:
        return np.repeat((gyro, accel), 3)


# By Allan variance of recordings at rest, as the data sets publish them.
DEVICES = {
    # EuRoC MAV: sensor.yaml of imu0
    "adis16448": ImuErrors(1.6968e-4, 1.9393e-5, 2.0e-3, 3.0e-3),
    # TUM VI: values from its Allan plots, not the inflated ones
    "bmi160": ImuErrors(8.0e-5, 2.2e-6, 1.4e-3, 8.6e-5),
    "ideal": ImuErrors(),
}


@dataclass(frozen=True, eq=False, repr=False)
class MountedImu(MountedSensor):
    """Inertial measurement unit on its vehicle.

    Attributes:
        rate_hz: readings a second.
        gravity_mps2: along the world's −z.
        errors: of each axis.
        base_from_imu: (4, 4).
    """

    rate_hz: float
    gravity_mps2: float
    errors: ImuErrors
    base_from_imu: NDArray[np.float64]
    noun: ClassVar[str] = "IMU"
    suffixes: ClassVar[tuple[str, ...]] = (READINGS_SUFFIX,)
    document_names: ClassVar[tuple[str, ...]] = (PARAMETERS,)

    @property
    def origin_m(self) -> NDArray[np.float64]:
        """Place of its accelerometers (3,), base."""
        return self.base_from_imu[:3, 3]

    @property
    def near_m(self) -> float:
        """Infinite: it sees nothing, and may be inside of the body."""
        return math.inf

    def summary(self) -> str:
        """Rate and gravity."""
        return f"{self.rate_hz:g} Hz, gravity {self.gravity_mps2:g} m/s²"

    def documents(self) -> dict[str, str]:
        """Mount, rate and noise, with the keys of EuRoC's sensor.yaml; the body is the base."""
        errors = self.errors
        numbers = {
            "rate_hz": self.rate_hz,
            "gyroscope_noise_density": errors.gyro_noise_radps_per_sqrt_hz,
            "gyroscope_random_walk": errors.gyro_bias_walk_radps2_per_sqrt_hz,
            "accelerometer_noise_density": errors.accel_noise_mps2_per_sqrt_hz,
            "accelerometer_random_walk": errors.accel_bias_walk_mps3_per_sqrt_hz,
            "gravity_mps2": self.gravity_mps2,
        }
        pose = ", ".join(map(_yaml_number, self.base_from_imu.ravel()))
        lines = ("sensor_type: imu", "T_BS:", "  cols: 4", "  rows: 4", f"  data: [{pose}]")
        rest = (f"{key}: {_yaml_number(number)}" for key, number in numbers.items())
        return {PARAMETERS: "\n".join((*lines, *rest)) + "\n"}

    def check_trajectory(self, truth: Trajectory) -> None:
        """Refuse more readings than memory holds, and turns between poses that are too wide.

        Raises:
            RunError: naming sensor, what is wrong, and what is expected.
        """
        if truth.duration_s * self.rate_hz >= MAX_READINGS:
            raise RunError(
                f"sensor {self.name!r}: rate_hz = {self.rate_hz:g}: expected fewer than "
                f"{MAX_READINGS} readings, got {truth.duration_s:g} s of them"
            )
        rotations = truth.world_from_base[:, :3, :3]
        turns_deg = np.abs(np.degrees(rotation_angles(rotations[:-1], rotations[1:])))
        if np.any(turns_deg > MAX_TURN_DEG):
            step = int(np.argmax(turns_deg))
            raise RunError(
                f"sensor {self.name!r}: step {step} → {step + 1}: expected a turn of at most "
                f"{MAX_TURN_DEG:g}°, got {turns_deg[step]:.4g}°"
            )

    def open(self, stage: Stage, settings: DriveSettings) -> Instrument:
        """Open it; it needs nothing of the stage."""
        key = key_of("imu", settings.seed, self.name)
        return ImuInstrument(self, settings.trajectory, key)


class ImuMount(SensorMount):
    """Inertial measurement unit: angular rate and specific force, at its own rate."""

    sensor_class: ClassVar[type[MountedSensor]] = MountedImu

    type: Literal["imu"]
    device: Literal["adis16448", "bmi160", "ideal"] = "adis16448"
    """Whose noise: "adis16448" as in EuRoC, "bmi160" as in TUM VI, "ideal": none."""
    rate_hz: Annotated[Number, Field(ge=1e-3, le=1e5)] = 200.0
    """Readings a second, from the first pose on."""
    gravity_mps2: Level = STANDARD_GRAVITY_MPS2
    """Gravity along the world's −z; at rest and level the specific force is as much along z."""
    gyro_noise_radps_per_sqrt_hz: Level | None = None
    """Density of the angular rate's white noise, rad/s/√Hz; left out: the device's."""
    gyro_bias_walk_radps2_per_sqrt_hz: Level | None = None
    """Random walk of its bias, rad/s²/√Hz; left out: the device's."""
    accel_noise_mps2_per_sqrt_hz: Level | None = None
    """Density of the specific force's white noise, m/s²/√Hz; left out: the device's."""
    accel_bias_walk_mps3_per_sqrt_hz: Level | None = None
    """Random walk of its bias, m/s³/√Hz; left out: the device's."""
    gyro_bias_sigma_radps: Level = 0.0
    """Standard deviation of the angular rate's bias at the start."""
    accel_bias_sigma_mps2: Level = 0.0
    """Standard deviation of the specific force's bias at the start."""

    def sensor(self, folder: Path, source: str) -> MountedSensor:
        """Mount the unit."""
        names = [field.name for field in dataclasses.fields(ImuErrors)]
        given = {name: getattr(self, name) for name in names if getattr(self, name) is not None}
        errors = dataclasses.replace(DEVICES[self.device], **given)
        return MountedImu(
            self.type,
            self.name,
            self.hides,
            self.rate_hz,
            self.gravity_mps2,
            errors,
            self.base_from_mount,
        )


class ImuInstrument(Instrument):
    """Takes the readings of an inertial measurement unit.

    Args:
        imu: on its vehicle.
        trajectory: of the vehicle's base.
        key: of its random numbers.
    """

    def __init__(self, imu: MountedImu, trajectory: Trajectory, key: int):
        self._imu, self._key = imu, key
        self._start_s = float(trajectory.times_s[0])
        self._motion = SmoothMotion(trajectory)
        count = self._count_to(float(trajectory.times_s[-1]))
        self._biases = imu.errors.biases(count, imu.rate_hz, key)

    def close(self) -> None:
        """Do nothing: there is nothing to free."""

    def measure(self, moment: Moment) -> Readings:
        """Take the readings since the step before, up to this one's time; at the first step one."""
        imu = self._imu
        first = 0 if moment.previous_s is None else self._count_to(moment.previous_s)
        indices = np.arange(first, self._count_to(moment.time_s))
        times_s = self._start_s + indices / imu.rate_hz
        ideal = true_readings(self._motion, imu.base_from_imu, imu.gravity_mps2, times_s)
        noise = imu.errors.noise(indices, imu.rate_hz, self._key)
        return Readings(times_s, ideal + self._biases[indices] + noise)

    def _count_to(self, time_s: float) -> int:
        """Number of readings from the start to a time."""
        return math.floor((time_s - self._start_s) * self._imu.rate_hz + LATE) + 1


@dataclass(frozen=True, eq=False)
class Readings(Measurement):
    """Readings between two steps.

    Attributes:
        times_s: (n,).
        values: (n, 6) angular rate in rad/s and specific force in m/s², frame of the unit.
    """

    times_s: NDArray[np.float64]
    values: NDArray[np.float64]

    def save(self, stem: Path) -> None:
        """Write the readings as CSV where they are missing.

        Raises:
            OutputError: the file cannot be written.
        """
        target = stem.with_suffix(READINGS_SUFFIX)
        if is_written(target):
            return
        rows = np.column_stack((self.times_s, self.values)).tolist()
        lines = (",".join(f"{value:.9f}" for value in row) for row in rows)
        write_text(target, "\n".join((COLUMNS, *lines)) + "\n")


def true_readings(
    motion: SmoothMotion,
    base_from_imu: NDArray[np.float64],
    gravity_mps2: float,
    times_s: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Angular rate and specific force (n, 6) at times (n,), without errors, frame of the unit.

    Args:
        motion: of the base.
        base_from_imu: (4, 4); away from the base's origin turning adds accelerations.
        gravity_mps2: along the world's −z.
        times_s: of the readings.
    """
    moved = motion.at(times_s)
    lever_m, rate = base_from_imu[:3, 3], moved.angular_rate_radps
    upward = moved.acceleration_mps2 + (0.0, 0.0, gravity_mps2)
    force = np.einsum("nij,ni->nj", moved.world_from_base, upward)
    force += np.cross(moved.angular_acceleration_radps2, lever_m)
    force += np.cross(rate, np.cross(rate, lever_m))
    turn = base_from_imu[:3, :3]
    return np.concatenate((rate @ turn, force @ turn), axis=1)


def _numbers(indices: NDArray[np.int64], stream: int, key: int) -> NDArray[np.float64]:
    """Two sets of normal numbers (2, n, 6) for readings (n,) and axes."""
    hashes = pcg4d(indices[:, None], np.arange(6), stream, key)
    return np.stack((normal(hashes[0], hashes[1]), normal(hashes[2], hashes[3]))).astype(np.float64)


def _yaml_number(number: float) -> str:
    """Number as YAML 1.1 reads one: with a point, also before an exponent."""
    return np.format_float_scientific(number, trim="0")
