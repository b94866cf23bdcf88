"""Range sensors of one number: sonars and infrared sensors, as USARSim has them.

A sonar hears the nearest surface in a cone: rays lie on cones about its axis, evenly from the axis
to the edge, and the shortest range counts. An infrared sensor has one ray.

Not in the model: what a sonar loses by slanted surfaces, which reflect the sound away, and echoes.
USARSim's limit to the angle of incidence is left out; as its sources have it, it is never met.

Source: USARSim's SonarSensor and IRSensor, and their defaults in its configuration.
"""

from __future__ import annotations

import json
import math
from collections.abc import Collection
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field

from omnisim.core.files.atomic_file import write_text
from omnisim.core.files.parameters import NotNegative, Parameters, Positive
from omnisim.core.poses import check_pose, pose
from omnisim.core.short_repr import short_repr
from omnisim.core.version import __version__
from omnisim.core.world import ObjectPart, WorldState
from omnisim.rendering.backend import RangeFinder
from omnisim.rendering.stage import BackendName, SensorRenderer, Stage
from omnisim.scene import Scene
from omnisim.sensors.laser_scanner.laser_scanner import MAX_SEED, LaserScanner

Count = Annotated[int, Field(strict=True, ge=1, le=360)]


@dataclass(frozen=True, kw_only=True)
class RangeSensor(Parameters, name="range_sensor"):
    """Cone and error model of a range sensor. Without arguments: USARSim's sonar.

    Attributes:
        beam_angle_deg: of the whole cone; 0: one ray.
        cones: number of cones of rays about the axis.
        rays_per_cone: evenly about the axis.
        range_min_m, range_max_m: nearer hits are −inf; farther ones, and none, are +inf (REP 117).
        noise_share: standard deviation as a share of the range.
        seed: of the device: its noise follows from it.

    Raises:
        OpticsError: naming the parameter, what was expected and what was got.
    """

    beam_angle_deg: Annotated[float, Field(strict=True, ge=0.0, lt=180.0)] = 20.0
    cones: Count = 10
    rays_per_cone: Count = 16
    range_min_m: NotNegative = 0.1
    range_max_m: Positive = 5.0
    noise_share: NotNegative = 0.001
    seed: Annotated[int, Field(strict=True, ge=0, le=MAX_SEED)] = 0

    def __repr__(self) -> str:
        return short_repr(
            self, f"{self.beam_angle_deg:g}°", f"{self.range_min_m:g} to {self.range_max_m:g} m"
        )

    def _check(self) -> None:
        if self.range_min_m >= self.range_max_m:
            raise self._error("range_min_m", f"less than range_max_m = {self.range_max_m:g}")

    @cached_property
    def errors(self) -> LaserScanner:
        """Limits and errors, as a scanner of one beam."""
        return LaserScanner.usarsim(
            scan_fov_rad=1.0,
            resolution_rad=2.0,
            max_range_m=self.range_max_m,
            min_range_m=self.range_min_m,
            noise=self.noise_share,
            seed=self.seed,
        )

    @property
    def fan_rad(self) -> NDArray[np.float64]:
        """Angles (n,) of the rays in one plane through the axis."""
        if not self.beam_angle_deg:
            return np.zeros(1)
        half_rad = math.radians(0.5 * self.beam_angle_deg)
        # a ray and the one across the axis are in one plane
        least = -self.cones if self.rays_per_cone % 2 == 0 else 0
        return half_rad / self.cones * np.arange(least, self.cones + 1, dtype=np.float64)

    @property
    def rolls_deg(self) -> NDArray[np.float64]:
        """Degrees about the axis of the planes with rays; the first is upright."""
        if not self.beam_angle_deg:
            return np.zeros(1)
        planes = self.rays_per_cone // (2 if self.rays_per_cone % 2 == 0 else 1)
        return 90.0 + 360.0 / self.rays_per_cone * np.arange(planes, dtype=np.float64)


@dataclass(frozen=True, eq=False)
class RangeReading:
    """Reading of a range sensor.

    Attributes:
        range_m: +inf: out of range; −inf: too near (REP 117).
        sensor: that took it.
        world_from_sensor: (4, 4) its pose; its axis is x.
        metadata: omnisim's version, the scene, the number of the reading.
    """

    range_m: float
    sensor: RangeSensor
    world_from_sensor: NDArray[np.float64]
    metadata: dict[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        return short_repr(self, f"{self.range_m:g} m", repr(self.sensor))

    def save_csv(self, path: str | Path) -> None:
        """Write the column range_m after lines `# key: value` in JSON; written atomically.

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
        lines = [
            f"# {key}: {json.dumps(value, ensure_ascii=False)}" for key, value in header.items()
        ]
        write_text(Path(path), "\n".join((*lines, "range_m", f"{self.range_m:.6f}")) + "\n")


class RangeSensorRenderer(SensorRenderer[RangeFinder]):
    """Takes a range sensor's readings in a scene; loads and compiles everything once.

    Use it as a context manager, or `close` it: it holds memory of the GPU.

    Args:
        scene: to measure, or its path or built-in name; or a stage that other sensors share.
        sensor: by default USARSim's sonar.
        base_from_sensor: (4, 4) its mount on the vehicle, along x; by default at the base.
        body: of the vehicle, in its base frame; a stage has its own.
        hidden: names of the body's instances that rays go through.
        device: EGL's number of the GPU, as `omnisim info` lists them; None takes the first. A
            stage has chosen already.
        vehicle: name of the vehicle that carries the sensor, of a stage with several.
        backend: "cube" casts rays by OpenGL, "rays" by Embree. A stage has chosen already.

    Raises:
        GraphicsError: no OpenGL, too old an OpenGL, or a scene past its limits.
        SceneError: a hidden name that the body does not have.
    """

    def __init__(
        self,
        scene: Scene | Stage | str | Path,
        sensor: RangeSensor | None = None,
        *,
        base_from_sensor: ArrayLike | None = None,
        body: Scene | None = None,
        hidden: Collection[str] = (),
        device: int | None = None,
        vehicle: str | None = None,
        backend: BackendName | None = None,
    ):
        self.sensor = RangeSensor() if sensor is None else sensor
        self._base_from_sensor = check_pose(
            np.eye(4) if base_from_sensor is None else base_from_sensor
        )
        self._rolls = [pose(roll_deg=float(roll)) for roll in self.sensor.rolls_deg]

        def make_passes(stage: Stage, parts: frozenset[ObjectPart]) -> RangeFinder:
            reach_m = self.sensor.errors.reach_m
            return stage.backend.range_finder(self.sensor.fan_rad, reach_m, parts)

        super().__init__(scene, body, hidden, device, make_passes, vehicle, backend)

    def _sensor_summary(self) -> str:
        return f"{self.sensor.beam_angle_deg:g}°"

    def measure(self, state: WorldState | ArrayLike, number: int = 0) -> RangeReading:
        """Take one reading.

        Args:
            state: of the world; or, where nothing else moves, the (4, 4) pose of the vehicle.
            number: of the reading; the noise depends on it and on the sensor's seed alone.

        Raises:
            OmnisimError: a matrix that is not a pose, an object without one, a number that is none,
                or the renderer or its stage is closed.
        """
        now = self._state(state)
        world_from_sensor = now.world_from_object[self.vehicle] @ self._base_from_sensor
        objects = self._stage.poses_in(now)
        with self._current() as ranges:
            fans = [ranges.cast(world_from_sensor @ roll, objects) for roll in self._rolls]
        nearest_m = np.concatenate(fans).min(keepdims=True)
        (range_m,) = self.sensor.errors.measure(nearest_m, number).tolist()
        metadata = {
            "omnisim": __version__,
            "scene": self.scene.name,
            **self._body_metadata(),
            "number": int(number),
        }
        return RangeReading(range_m, self.sensor, world_from_sensor, metadata)
