"""USARSim's sonars and infrared sensors on vehicles: one range per measurement."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from omnisim.core.files.parameters import Number, overriding
from omnisim.sensors.range_sensor.range_sensor import RangeSensor, RangeSensorRenderer
from omnisim.sensors.sensor import (
    TABLE_SUFFIX,
    DriveSettings,
    FileMeasurement,
    Moment,
    MountedSensor,
    RenderedSensor,
)
from omnisim.sensors.sensor_mount import SensorMount

_ERRORS = ("range_max_m", "range_min_m", "noise_share", "seed")
_INFRARED = {"range_min_m": 0.2, "range_max_m": 1.5}


class MountedRangeSensor(RenderedSensor):
    """Sonar or infrared sensor mounted on a vehicle."""

    sensor: RangeSensor
    noun: ClassVar[str] = "range"
    suffixes: ClassVar[tuple[str, ...]] = (TABLE_SUFFIX,)

    def measure(
        self, renderer: RangeSensorRenderer, settings: DriveSettings, moment: Moment
    ) -> FileMeasurement:
        """Render the range at a moment."""
        reading = renderer.measure(moment.motion(moment.time_s), moment.number)
        return FileMeasurement(TABLE_SUFFIX, reading.save_csv)


@overriding(RangeSensor, "cones", "rays_per_cone", *_ERRORS, defaults={})
class SonarMount(SensorMount):
    """Sonar with USARSim's parameters: the nearest hit of rays in a cone about x."""

    sensor_class: ClassVar[type[MountedSensor]] = MountedRangeSensor

    type: Literal["usarsim_sonar"]
    beam_angle_rad: Annotated[Number, Field(gt=0.0, lt=math.pi)] = 0.349
    """Full opening angle of the cone in radians: USARSim's beamAngle."""

    def parameters(self) -> RangeSensor:
        """Build the parameters of USARSim's sonar."""
        return self.overriding(RangeSensor(beam_angle_deg=math.degrees(self.beam_angle_rad)))


@overriding(RangeSensor, *_ERRORS, defaults=_INFRARED)
class InfraredMount(SensorMount):
    """Infrared sensor with USARSim's parameters: one ray along x."""

    sensor_class: ClassVar[type[MountedSensor]] = MountedRangeSensor

    type: Literal["usarsim_ir_sensor"]

    def parameters(self) -> RangeSensor:
        """Build the parameters of USARSim's infrared sensor."""
        return self.overriding(RangeSensor(beam_angle_deg=0.0))
