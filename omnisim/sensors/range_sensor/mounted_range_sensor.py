"""Sonars and infrared sensors on vehicles, as in USARSim: one range per step."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from omnisim.core.files.parameters import AboveZero, Level, Number, Seed
from omnisim.sensors.range_sensor.range_sensor import Count, RangeSensor, RangeSensorRenderer
from omnisim.sensors.sensor import (
    TABLE_SUFFIX,
    DriveSettings,
    FileMeasurement,
    Moment,
    MountedSensor,
    RenderedSensor,
)
from omnisim.sensors.sensor_mount import SensorMount


class MountedRangeSensor(RenderedSensor):
    """Sonar or infrared sensor on its vehicle."""

    sensor: RangeSensor
    noun: ClassVar[str] = "range"
    suffixes: ClassVar[tuple[str, ...]] = (TABLE_SUFFIX,)

    def measure(
        self, renderer: RangeSensorRenderer, settings: DriveSettings, moment: Moment
    ) -> FileMeasurement:
        """Measure the range at a moment."""
        reading = renderer.measure(moment.motion(moment.time_s), moment.number)
        return FileMeasurement(TABLE_SUFFIX, reading.save_csv)


class SonarMount(SensorMount):
    """Sonar of USARSim's configuration: the nearest hit of rays in a cone about x."""

    sensor_class: ClassVar[type[MountedSensor]] = MountedRangeSensor

    type: Literal["usarsim_sonar"]
    beam_angle_rad: Annotated[Number, Field(gt=0.0, lt=math.pi)] = 0.349
    """Opening angle of the cone in radians: USARSim's beamAngle."""
    cones: Count = 10
    """Cones of rays from the axis to the edge: USARSim's numberOfCones."""
    rays_per_cone: Count = 16
    """Rays per cone: USARSim's tracesPerCone."""
    range_max_m: AboveZero = 5.0
    """Meters; farther hits are out of range: USARSim's MaxRange."""
    range_min_m: Level = 0.1
    """Meters; nearer hits are too near: USARSim's MinRange."""
    noise_share: Level = 0.001
    """Standard deviation as a share of the range: USARSim's Noise."""
    seed: Seed = 0
    """Seed of the device's noise."""

    def parameters(self) -> RangeSensor:
        """Build USARSim's sonar."""
        return RangeSensor(
            beam_angle_deg=math.degrees(self.beam_angle_rad),
            cones=self.cones,
            rays_per_cone=self.rays_per_cone,
            range_min_m=self.range_min_m,
            range_max_m=self.range_max_m,
            noise_share=self.noise_share,
            seed=self.seed,
        )


class InfraredMount(SensorMount):
    """Infrared sensor of USARSim's configuration: one ray along x."""

    sensor_class: ClassVar[type[MountedSensor]] = MountedRangeSensor

    type: Literal["usarsim_ir_sensor"]
    range_max_m: AboveZero = 1.5
    """Meters; farther hits are out of range: USARSim's MaxRange."""
    range_min_m: Level = 0.2
    """Meters; nearer hits are too near: USARSim's MinRange."""
    noise_share: Level = 0.001
    """Standard deviation as a share of the range: USARSim's Noise."""
    seed: Seed = 0
    """Seed of the device's noise."""

    def parameters(self) -> RangeSensor:
        """Build USARSim's infrared sensor."""
        return RangeSensor(
            beam_angle_deg=0.0,
            range_min_m=self.range_min_m,
            range_max_m=self.range_max_m,
            noise_share=self.noise_share,
            seed=self.seed,
        )
