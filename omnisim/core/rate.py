"""Measurement times of sensors with their own rate, independent of the drive's steps."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from omnisim.core.arrays import Floats, Ints
from omnisim.core.errors import RunError
from omnisim.core.random_numbers import key_of, normal, pcg4d

MAX_MEASUREMENTS = 10_000_000  # half a gigabyte of stamps and readings; 14 hours at 200 Hz
LATE = 1e-3  # tolerance as a share of the period: printed times are rounded


@dataclass(frozen=True)
class SensorRate:
    """Rate of one sensor, or of all sensors on a trigger.

    Attributes:
        rate_hz: measurements per second, from the start of the drive.
        phase_s: time of the first measurement since the start of the drive.
        jitter_s: standard deviation of the stamps.
        clock: name of the sensor or of its trigger, which determines the jitter.
    """

    rate_hz: float
    phase_s: float
    jitter_s: float
    clock: str

    def times_s(self, start_s: float, end_s: float, seed: int, sensor: str) -> Floats:
        """Times (n,) of the measurements of a drive, n ≥ 1, in whole nanoseconds.

        `seed` is the drive's; `sensor` names the sensor in messages.

        Raises:
            RunError: no measurement falls into the drive, or there are too many for memory.
        """
        duration_s = end_s - start_s - self.phase_s
        count = math.floor(duration_s * self.rate_hz + LATE) + 1
        if count >= MAX_MEASUREMENTS:
            raise RunError(
                f"sensor {sensor!r}: rate_hz = {self.rate_hz:g}: expected fewer than "
                f"{MAX_MEASUREMENTS} readings, got {count} in {duration_s:g} s"
            )
        if count < 1:
            raise RunError(
                f"sensor {sensor!r}: phase_s = {self.phase_s:g}: expected at most "
                f"{end_s - start_s:g}, the duration of the drive"
            )
        return self.stamps_s(np.arange(count), start_s, end_s, seed)

    def stamps_s(self, indices: Ints, start_s: float, end_s: float, seed: int) -> Floats:
        """Times (n,) of measurements by their indices (n,), see `times_s`."""
        times_s = start_s + self.phase_s + indices / self.rate_hz
        if self.jitter_s > 0.0:
            hashes = pcg4d(indices, 0, 0, key_of("jitter", seed, self.clock))
            # normal numbers are at most 5.77: stamps keep their order
            times_s += self.jitter_s * normal(hashes[0], hashes[1])
        return printed_s(np.clip(times_s, start_s, end_s))


def printed_s(times_s: Floats) -> Floats:
    """Round times (n,) to the nine decimals of the files."""
    return np.array([float(f"{time_s:.9f}") for time_s in times_s.tolist()])
