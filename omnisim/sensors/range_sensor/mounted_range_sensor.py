"""Sonars and infrared sensors on vehicles, as USARSim has them: one range a step."""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from omnisim.core.errors import OpticsError, RobotFileError
from omnisim.core.files.parameters import Number
from omnisim.rendering.stage import Stage
from omnisim.sensors.range_sensor.range_sensor import Count, RangeSensor, RangeSensorRenderer
from omnisim.sensors.sensor import (
    TABLE_SUFFIX,
    DriveSettings,
    Instrument,
    Moment,
    MountedSensor,
    RendererInstrument,
    TableMeasurement,
)
from omnisim.sensors.sensor_mount import Level, Positive, Seed, SensorMount


@dataclass(frozen=True, eq=False, repr=False)
class MountedRangeSensor(MountedSensor):
    """Sonar or infrared sensor on its vehicle.

    Attributes:
        sensor: cone and error model.
        base_from_sensor: (4, 4); its axis is x.
    """

    sensor: RangeSensor
    base_from_sensor: NDArray[np.float64]
    noun: ClassVar[str] = "range"
    suffixes: ClassVar[tuple[str, ...]] = (TABLE_SUFFIX,)

    @property
    def origin_m(self) -> NDArray[np.float64]:
        """Origin of its rays (3,), base."""
        return self.base_from_sensor[:3, 3]

    def summary(self) -> str:
        """Cone and range."""
        angle_deg, range_max_m = self.sensor.beam_angle_deg, self.sensor.range_max_m
        rays = f"cone of {angle_deg:.3g}°" if angle_deg else "one ray"
        return f"{rays} to {range_max_m:g} m"

    def open(self, stage: Stage, settings: DriveSettings) -> Instrument:
        """Open a renderer of ranges."""
        renderer = RangeSensorRenderer(
            stage,
            self.sensor,
            base_from_sensor=self.base_from_sensor,
            hidden=self.hides,
            vehicle=settings.vehicle,
        )
        return RangeInstrument(renderer)


class _RangeSensorMount(SensorMount):
    """Keys of sonars and infrared sensors."""

    sensor_class: ClassVar[type[MountedSensor]] = MountedRangeSensor

    @abstractmethod
    def range_sensor(self) -> RangeSensor:
        """Build the cone and error model.

        Raises:
            OpticsError: a sensor that cannot be.
        """

    def sensor(self, folder: Path, source: str) -> MountedSensor:
        """Mount the sensor."""
        try:
            sensor = self.range_sensor()
        except OpticsError as reason:
            raise RobotFileError(f"{source}: {str(reason).removeprefix('range_sensor.')}") from None
        return MountedRangeSensor(self.type, self.name, self.hides, sensor, self.base_from_mount)


class SonarMount(_RangeSensorMount):
    """Sonar as USARSim's configuration has it: the nearest hit of rays in a cone about x."""

    type: Literal["usarsim_sonar"]
    beam_angle_rad: Annotated[Number, Field(gt=0.0, lt=math.pi)] = 0.349
    """Radians across the cone: USARSim's beamAngle."""
    cones: Count = 10
    """Cones of rays from the axis to the edge: USARSim's numberOfCones."""
    rays_per_cone: Count = 16
    """Rays on each: USARSim's tracesPerCone."""
    range_max_m: Positive = 5.0
    """Meters; farther hits are out of range: USARSim's MaxRange."""
    range_min_m: Level = 0.1
    """Meters; nearer hits are too near: USARSim's MinRange."""
    noise_share: Level = 0.001
    """Standard deviation as a share of the range: USARSim's Noise."""
    seed: Seed = 0
    """Seed of the device: its noise follows from it."""

    def range_sensor(self) -> RangeSensor:
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


class InfraredMount(_RangeSensorMount):
    """Infrared sensor as USARSim's configuration has it: one ray along x."""

    type: Literal["usarsim_ir_sensor"]
    range_max_m: Positive = 1.5
    """Meters; farther hits are out of range: USARSim's MaxRange."""
    range_min_m: Level = 0.2
    """Meters; nearer hits are too near: USARSim's MinRange."""
    noise_share: Level = 0.001
    """Standard deviation as a share of the range: USARSim's Noise."""
    seed: Seed = 0
    """Seed of the device: its noise follows from it."""

    def range_sensor(self) -> RangeSensor:
        """Build USARSim's infrared sensor."""
        return RangeSensor(
            beam_angle_deg=0.0,
            range_min_m=self.range_min_m,
            range_max_m=self.range_max_m,
            noise_share=self.noise_share,
            seed=self.seed,
        )


class RangeInstrument(RendererInstrument[RangeSensorRenderer]):
    """Takes the readings of a sonar or infrared sensor."""

    def measure(self, moment: Moment) -> TableMeasurement:
        """Take the range of a moment."""
        return TableMeasurement(self._renderer.measure(moment.motion(moment.time_s), moment.number))
