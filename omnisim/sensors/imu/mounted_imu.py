"""Inertial measurement units on vehicles: readings at their own rate, in one file per run.

Noise and bias depend on the drive's seed, the sensor's name and the index of the reading.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import RunError
from omnisim.core.files.atomic_file import is_written
from omnisim.core.files.number_files import BLOCK, write_table
from omnisim.core.files.parameters import Level, overriding
from omnisim.core.poses import rotation_angles
from omnisim.core.random_numbers import key_of
from omnisim.core.trajectories import Trajectory
from omnisim.core.trajectories.body_motion import BodyMotion
from omnisim.sensors.imu.imu import DEVICES, STANDARD_GRAVITY_MPS2, ImuErrors, true_readings
from omnisim.sensors.rate import SensorRate
from omnisim.sensors.sensor import DriveSettings, MountedSensor, StepContent
from omnisim.sensors.sensor_mount import Rate, SensorMount

READINGS_SUFFIX, PARAMETERS = ".csv", "sensor.yaml"
READINGS, BIASES = "readings.csv", "biases.csv"
COLUMNS = "t_s,wx_radps,wy_radps,wz_radps,fx_mps2,fy_mps2,fz_mps2"
BIAS_COLUMNS = COLUMNS.replace(",w", ",bias_w").replace(",f", ",bias_f")
MAX_TURN_DEG = 120.0  # between poses: near a half turn a smooth motion is ambiguous


@dataclass(frozen=True, eq=False, repr=False)
class MountedImu(MountedSensor):
    """Inertial measurement unit mounted on a vehicle.

    Attributes:
        rate_hz: readings per second.
        gravity_mps2: gravity along the world's −z.
    """

    sensor: ImuErrors
    rate_hz: float = field(kw_only=True)
    gravity_mps2: float = field(kw_only=True)
    noun: ClassVar[str] = "IMU"
    suffixes: ClassVar[tuple[str, ...]] = (READINGS_SUFFIX,)
    document_names: ClassVar[tuple[str, ...]] = (PARAMETERS, READINGS, BIASES)

    @property
    def near_m(self) -> float:
        """Infinite: the unit does not see and may be inside the body."""
        return math.inf

    def summary(self) -> str:
        """Short description: rate and gravity."""
        return f"{self.rate_hz:g} Hz, gravity {self.gravity_mps2:g} m/s²"

    def documents(self) -> dict[str, str]:
        """Mount, rate and noise, with the keys of EuRoC's sensor.yaml; its body is the base."""
        errors = self.sensor
        numbers = {
            "rate_hz": self.rate_hz,
            "gyroscope_noise_density": errors.gyro_noise_radps_per_sqrt_hz,
            "gyroscope_random_walk": errors.gyro_bias_walk_radps2_per_sqrt_hz,
            "accelerometer_noise_density": errors.accel_noise_mps2_per_sqrt_hz,
            "accelerometer_random_walk": errors.accel_bias_walk_mps3_per_sqrt_hz,
            "gravity_mps2": self.gravity_mps2,
        }
        pose = ", ".join(map(_yaml_number, self.base_from_sensor.ravel()))
        lines = ("sensor_type: imu", "T_BS:", "  cols: 4", "  rows: 4", f"  data: [{pose}]")
        rest = (f"{key}: {_yaml_number(number)}" for key, number in numbers.items())
        return {PARAMETERS: "\n".join((*lines, *rest)) + "\n"}

    def check_trajectory(self, truth: Trajectory, times_s: NDArray[np.float64]) -> None:
        """Raise an error if the turn between two poses is too wide.

        Raises:
            RunError: a turn is too wide; names sensor, step, turn and limit.
        """
        rotations = truth.world_from_base[:, :3, :3]
        turns_deg = np.abs(np.degrees(rotation_angles(rotations[:-1], rotations[1:])))
        if np.any(turns_deg > MAX_TURN_DEG):
            step = int(np.argmax(turns_deg))
            raise RunError(
                f"sensor {self.name!r}: step {step} → {step + 1}: expected a turn of at most "
                f"{MAX_TURN_DEG:g}°, got {turns_deg[step]:.4g}°"
            )

    def times_s(self, step_times_s: NDArray[np.float64], seed: int) -> NDArray[np.float64]:
        """Times (n,) of the readings."""
        rate = self.rate or SensorRate(self.rate_hz, 0.0, 0.0, self.name)
        start_s, end_s = step_times_s[[0, -1]].tolist()
        return rate.times_s(start_s, end_s, seed, self.name)

    @classmethod
    def suffixes_of(cls, content: StepContent) -> tuple[str, ...]:
        """No suffixes: one file holds all readings. Runs of older versions have a file per step."""
        return () if "readings" in content.settings else cls.suffixes

    def settings(self) -> dict[str, Any]:
        """Setting with the name of the readings' file."""
        return {"readings": READINGS}

    def write_readings(
        self, folder: Path, settings: DriveSettings, times_s: NDArray[np.float64]
    ) -> None:
        """Write the files of all readings and of their biases, unless they exist.

        Raises:
            OutputError: a file cannot be written.
        """
        key = key_of("imu", settings.seed, self.name)
        biases = self.sensor.biases(len(times_s), self.rate_hz, key)
        parts = [slice(first, first + BLOCK) for first in range(0, len(times_s), BLOCK)]
        if not is_written(folder / READINGS):
            blocks = (self._block(settings.motion, times_s, biases, key, part) for part in parts)
            write_table(folder / READINGS, COLUMNS, blocks)
        if not is_written(folder / BIASES):
            blocks = (np.column_stack((times_s[part], biases[part])) for part in parts)
            write_table(folder / BIASES, BIAS_COLUMNS, blocks)

    def readings(
        self, motion: BodyMotion, seed: int, times_s: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Readings (n, 6) at times (n,): angular rates in rad/s, then specific forces in m/s²."""
        key = key_of("imu", seed, self.name)
        biases = self.sensor.biases(len(times_s), self.rate_hz, key)
        return self._block(motion, times_s, biases, key, slice(None))[:, 1:]

    def _block(
        self,
        motion: BodyMotion,
        times_s: NDArray[np.float64],
        biases: NDArray[np.float64],
        key: int,
        part: slice,
    ) -> NDArray[np.float64]:
        """Table rows (n, 7) of a slice of the readings, times first."""
        times, indices = times_s[part], np.arange(len(times_s))[part]
        ideal = true_readings(
            motion, self.base_from_sensor, self.gravity_mps2, times, 1.0 / self.rate_hz
        )
        noise = self.sensor.noise(indices, self.rate_hz, key)
        return np.column_stack((times, ideal + biases[part] + noise))


@overriding(ImuErrors)
class ImuMount(SensorMount):
    """Inertial measurement unit that measures angular rate and specific force at its own rate."""

    sensor_class: ClassVar[type[MountedSensor]] = MountedImu

    type: Literal["imu"]
    device: Literal["adis16448", "bmi160", "ideal"] = "adis16448"
    """Device that sets the noise: "adis16448" as in EuRoC, "bmi160" as in TUM VI, or "ideal"."""
    rate_hz: Rate | None = 200.0
    """Readings per second, from the start of the drive."""
    gravity_mps2: Level = STANDARD_GRAVITY_MPS2
    """Gravity along the world's −z; at rest and level, the specific force along z equals it."""

    def parameters(self) -> ImuErrors:
        """Build the errors, which all axes share."""
        return self.overriding(DEVICES[self.device])

    def settings(self) -> dict[str, Any]:
        """Rate and gravity of the mounted unit."""
        return {"rate_hz": self.rate_hz or 200.0, "gravity_mps2": self.gravity_mps2}


def _yaml_number(number: float) -> str:
    """Format a number as a YAML 1.1 float, which needs a point even before an exponent."""
    return np.format_float_scientific(number, trim="0")
