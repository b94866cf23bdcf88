"""Range sensors that measure a single number: USARSim's sonars and infrared sensors.

A sonar measures the distance of the nearest surface in a cone. Its rays lie on coaxial cones at
even angles from the axis to the edge, and the shortest range counts. An infrared sensor has one
ray.

The model omits echoes and the loss at slanted surfaces, which reflect the sound away. It also omits
USARSim's limit of the incidence angle, which never takes effect in USARSim's code.

Source: USARSim's SonarSensor and IRSensor, and their defaults in its configuration.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from omnisim.core.arrays import Floats
from omnisim.core.files import parameters
from omnisim.core.pending import Pending
from omnisim.core.poses import pose
from omnisim.core.short_repr import short_repr
from omnisim.core.world import ObjectPart
from omnisim.ground_truth.hits import ScanBeams
from omnisim.rendering.contract import RangeFinder
from omnisim.rendering.instrument import Instrument
from omnisim.rendering.sensor import TABLE_SUFFIX, Moment, Mount, SensorSettings
from omnisim.rendering.shared_scene import SharedScene
from omnisim.sensors.device_data import write_commented_csv
from omnisim.sensors.laser_scanner.laser_scanner import LaserScanner
from omnisim.sensors.sensor_table import SensorTable

Count = Annotated[int, Field(strict=True, ge=1, le=360)]


@dataclass(frozen=True, kw_only=True)
class RangeSensor(parameters.Parameters, SensorSettings, name="range_sensor"):
    """Cone and error model of a range sensor; the default is USARSim's sonar."""

    beam_angle_deg: Annotated[parameters.Number, Field(ge=0.0, lt=180.0)] = 20.0
    """Full opening angle of the cone; 0: one ray."""
    cones: Count = 10
    """Number of ray cones from the axis to the edge: USARSim's numberOfCones."""
    rays_per_cone: Count = 16
    """Number of rays per cone, evenly spaced about the axis: USARSim's tracesPerCone."""
    range_min_m: parameters.NotNegative = 0.1
    """Minimum range in meters; nearer hits are too near, −inf (REP 117): USARSim's MinRange."""
    range_max_m: parameters.Positive = 5.0
    """Maximum range in meters; farther hits are out of range, +inf: USARSim's MaxRange."""
    noise_share: parameters.NotNegative = 0.001
    """Standard deviation relative to the range: USARSim's Noise."""
    seed: parameters.Seed = 0
    """Seed of the device, which determines its noise."""

    noun: ClassVar[str] = "range"
    suffixes: ClassVar[tuple[str, ...]] = (TABLE_SUFFIX,)

    def __repr__(self) -> str:
        return short_repr(
            self, f"{self.beam_angle_deg:g}°", f"{self.range_min_m:g} to {self.range_max_m:g} m"
        )

    def summary(self) -> str:
        """Short description: cone and range."""
        rays = f"cone of {self.beam_angle_deg:.3g}°" if self.beam_angle_deg else "one ray"
        return f"{rays} to {self.range_max_m:g} m"

    def open(self, stage: SharedScene, mount: Mount[object]) -> RangeSensorRenderer:
        """Open a renderer of range readings on a stage."""
        return RangeSensorRenderer(stage, self, mount)

    def _check(self) -> None:
        if self.range_min_m >= self.range_max_m:
            raise self._error("range_min_m", f"less than range_max_m = {self.range_max_m:g}")

    @cached_property
    def errors(self) -> LaserScanner:
        """Limits and errors, as those of a scanner with a single beam."""
        return LaserScanner.usarsim(
            scan_fov_rad=1.0,
            resolution_rad=2.0,
            max_range_m=self.range_max_m,
            min_range_m=self.range_min_m,
            noise=self.noise_share,
            seed=self.seed,
        )

    @property
    def fan_rad(self) -> Floats:
        """Angles (n,) of the rays in one plane through the axis."""
        if not self.beam_angle_deg:
            return np.zeros(1)
        half_rad = math.radians(0.5 * self.beam_angle_deg)
        # with an even number, a ray and its opposite ray share a plane
        least = -self.cones if self.rays_per_cone % 2 == 0 else 0
        return half_rad / self.cones * np.arange(least, self.cones + 1, dtype=np.float64)

    @property
    def rolls_deg(self) -> Floats:
        """Roll angles (planes,) in degrees of the planes with rays; the first plane is upright."""
        if not self.beam_angle_deg:
            return np.zeros(1)
        planes = self.rays_per_cone // (2 if self.rays_per_cone % 2 == 0 else 1)
        return 90.0 + 360.0 / self.rays_per_cone * np.arange(planes, dtype=np.float64)


@dataclass(frozen=True, eq=False)
class RangeReading:
    """Reading of a range sensor.

    Attributes:
        range_m: measured range; +inf: out of range; −inf: too near (REP 117).
        sensor: sensor of the reading.
        world_from_sensor: (4, 4) pose of the sensor, whose axis is x.
        metadata: omnisim's version, the scene and the reading's number.
    """

    range_m: float
    sensor: RangeSensor
    world_from_sensor: Floats
    metadata: dict[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        return short_repr(self, f"{self.range_m:g} m", repr(self.sensor))

    def save(self, stem: Path) -> None:
        """Write the range as CSV, see `save_csv`.

        Raises:
            OutputError: the file cannot be written.
        """
        self.save_csv(stem.with_suffix(TABLE_SUFFIX))

    def save_csv(self, path: str | Path) -> None:
        """Atomically write the column range_m after comment lines `# key: value` with JSON values.

        Raises:
            OutputError: the file cannot be written.
        """
        header = {
            **self.metadata,
            "beam_angle_deg": self.sensor.beam_angle_deg,
            "range_min_m": self.sensor.range_min_m,
            "range_max_m": self.sensor.range_max_m,
            "world_from_sensor": self.world_from_sensor.tolist(),
        }
        write_commented_csv(path, header, "range_m", (f"{self.range_m:.6f}",))


class RangeSensorRenderer(Instrument[RangeSensor, RangeFinder, RangeReading]):
    """Renders a range sensor's readings in a scene."""

    def _open_passes(self, hidden: frozenset[ObjectPart]) -> RangeFinder:
        reach_m = self.sensor.errors.reach_m
        return self._stage.backend.range_finder(ScanBeams(self.sensor.fan_rad, reach_m), hidden)

    def begin(self, moment: Moment) -> Pending[RangeReading]:
        """Render the reading at a moment; with the sensor's seed its number sets the noise."""
        now = self._state(moment.motion(moment.time_s))
        world_from_sensor, objects = self._world_from_sensor(now), self._stage.poses_in(now)
        rolls = [pose(roll_deg=float(roll)) for roll in self.sensor.rolls_deg]
        with self._current() as ranges:
            fans = [ranges.cast(world_from_sensor @ roll, objects) for roll in rolls]
        nearest_m = np.concatenate(fans).min(keepdims=True)
        (range_m,) = self.sensor.errors.measure(nearest_m, moment.number).tolist()
        metadata = self._metadata(number=int(moment.number))
        return Pending.done(RangeReading(range_m, self.sensor, world_from_sensor, metadata))


# Tables of a robot file, with the names and defaults of USARSim.

_ERRORS = ("range_max_m", "range_min_m", "noise_share", "seed")
_INFRARED = {"range_min_m": 0.2, "range_max_m": 1.5}


@parameters.overriding(RangeSensor, "cones", "rays_per_cone", *_ERRORS, defaults={})
class SonarTable(SensorTable):
    """Sonar with USARSim's parameters: the nearest hit of rays in a cone about x."""

    sensor_class: ClassVar[type[SensorSettings]] = RangeSensor

    type: Literal["usarsim_sonar"]
    beam_angle_rad: Annotated[parameters.Number, Field(gt=0.0, lt=math.pi)] = 0.349
    """Full opening angle of the cone in radians: USARSim's beamAngle."""

    def sensor(self) -> RangeSensor:
        """Build the settings of USARSim's sonar."""
        return self.overriding(RangeSensor(beam_angle_deg=math.degrees(self.beam_angle_rad)))


@parameters.overriding(RangeSensor, *_ERRORS, defaults=_INFRARED)
class InfraredTable(SensorTable):
    """Infrared sensor with USARSim's parameters: one ray along x."""

    sensor_class: ClassVar[type[SensorSettings]] = RangeSensor

    type: Literal["usarsim_ir_sensor"]

    def sensor(self) -> RangeSensor:
        """Build the settings of USARSim's infrared sensor."""
        return self.overriding(RangeSensor(beam_angle_deg=0.0))
