"""USARSim's sonars and infrared sensors on vehicles: one range per measurement."""

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


class SonarMount(SensorMount):
    """Sonar with USARSim's parameters: the nearest hit of rays in a cone about x."""

    sensor_class: ClassVar[type[MountedSensor]] = MountedRangeSensor

    type: Literal["usarsim_sonar"]
    beam_angle_rad: Annotated[Number, Field(gt=0.0, lt=math.pi)] = 0.349
    """Full opening angle of the cone in radians: USARSim's beamAngle."""
    cones: Count = 10
    """Number of ray cones from the axis to the edge: USARSim's numberOfCones."""
    rays_per_cone: Count = 16
    """Number of rays per cone: USARSim's tracesPerCone."""
    range_max_m: AboveZero = 5.0
    """Maximum range in meters; farther hits are out of range: USARSim's MaxRange."""
    range_min_m: Level = 0.1
    """Minimum range in meters; nearer hits are too near: USARSim's MinRange."""
    noise_share: Level = 0.001
    """Standard deviation relative to the range: USARSim's Noise."""
    seed: Seed = 0
    """Seed of the device, which determines its noise."""

    def parameters(self) -> RangeSensor:
        """Build the parameters of USARSim's sonar."""
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
    """Infrared sensor with USARSim's parameters: one ray along x."""

    sensor_class: ClassVar[type[MountedSensor]] = MountedRangeSensor

    type: Literal["usarsim_ir_sensor"]
    range_max_m: AboveZero = 1.5
    """Maximum range in meters; farther hits are out of range: USARSim's MaxRange."""
    range_min_m: Level = 0.2
    """Minimum range in meters; nearer hits are too near: USARSim's MinRange."""
    noise_share: Level = 0.001
    """Standard deviation relative to the range: USARSim's Noise."""
    seed: Seed = 0
    """Seed of the device, which determines its noise."""

    def parameters(self) -> RangeSensor:
        """Build the parameters of USARSim's infrared sensor."""
        return RangeSensor(
            beam_angle_deg=0.0,
            range_min_m=self.range_min_m,
            range_max_m=self.range_max_m,
            noise_share=self.noise_share,
            seed=self.seed,
        )
