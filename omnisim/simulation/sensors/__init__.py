"""Sensors of vehicles: their tables in a robot file, what they measure, and its files.

A sensor is one module here and its entry in `registry.py`.
"""

from omnisim.simulation.sensors.omnicamera import MountedCamera
from omnisim.simulation.sensors.range_scanner import MountedScanner
from omnisim.simulation.sensors.sensor import (
    DriveSettings,
    Instrument,
    Measurement,
    Moment,
    MountedSensor,
)

__all__ = [
    "DriveSettings",
    "Instrument",
    "Measurement",
    "Moment",
    "MountedCamera",
    "MountedScanner",
    "MountedSensor",
]
