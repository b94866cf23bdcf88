"""Inertial measurement units on vehicles: readings at their own rate, in the file of each step.

Noise and bias follow from the drive's seed, the sensor's name and the number of the reading: any
step can be measured by itself.
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
from omnisim.sensors.degradations.random_numbers import key_of
from omnisim.sensors.imu import DEVICES, STANDARD_GRAVITY_MPS2, ImuErrors, true_readings
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
from omnisim.trajectories.body_motion import BodyMotion

READINGS_SUFFIX, PARAMETERS = ".csv", "sensor.yaml"
COLUMNS = "t_s,wx_radps,wy_radps,wz_radps,fx_mps2,fy_mps2,fz_mps2"
MAX_READINGS = 10_000_000  # half a gigabyte; 14 hours at 200 Hz
MAX_TURN_DEG = 120.0  # from pose to pose: near half a turn no smooth motion is found
LATE = 1e-3  # of the time between readings: printed times are rounded


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
        return ImuInstrument(self, settings.motion, key)


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
        motion: of the vehicle's base.
        key: of its random numbers.
    """

    def __init__(self, imu: MountedImu, motion: BodyMotion, key: int):
        self._imu, self._key = imu, key
        self._start_s, self._motion = motion.start_s, motion
        count = self._count_to(motion.end_s)
        self._biases = imu.errors.biases(count, imu.rate_hz, key)

    def close(self) -> None:
        """Do nothing: there is nothing to free."""

    def measure(self, moment: Moment) -> Readings:
        """Take the readings since the step before, up to this one's time; at the first step one."""
        imu = self._imu
        first = 0 if moment.previous_s is None else self._count_to(moment.previous_s)
        indices = np.arange(first, self._count_to(moment.time_s))
        times_s = self._start_s + indices / imu.rate_hz
        ideal = true_readings(
            self._motion, imu.base_from_imu, imu.gravity_mps2, times_s, 1.0 / imu.rate_hz
        )
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


def _yaml_number(number: float) -> str:
    """Number as YAML 1.1 reads one: with a point, also before an exponent."""
    return np.format_float_scientific(number, trim="0")
