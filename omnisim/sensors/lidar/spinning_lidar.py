"""Spinning 3-D lidars: rings, limits, noise, and their point clouds of a scene.

Frame of the lidar: x forward, y left, z up (REP 103). All lasers start at its origin; ring 0 points
down the most, as in ROS drivers. The head turns clockwise seen from above, as Velodyne's do, and a
revolution begins straight behind. All rings of a firing fire at once, in one direction; a laser has
one return. The devices' lasers fire within 46 µs, their lenses are some centimeters apart, and a
beam
that two surfaces share has two returns: this is not modeled.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field

from omnisim.core.files.parameters import NotNegative, Number, Parameters, Positive, Seed
from omnisim.core.short_repr import short_repr
from omnisim.core.world import Motion, ObjectPart, WorldState
from omnisim.ground_truth.lidar_beams import LidarBeams, LidarPoses
from omnisim.rendering.backend import BeamCaster, LabelCache
from omnisim.rendering.sensor_renderer import Mounting, SensorRenderer
from omnisim.rendering.shared_scene import SharedScene
from omnisim.rendering.truth.ground_truth import instances_of_draws
from omnisim.rendering.truth.moving_boxes import MovingBoxes
from omnisim.sensors.device_noise import check_number, rounded
from omnisim.sensors.lidar.point_files import POINT, write_points
from omnisim.sensors.lidar.revolution import plan_revolution

MAX_RINGS, MAX_FIRINGS = 1024, 16384
MAX_ELEVATION_DEG = 80.0
VLP16_ELEVATIONS_DEG = tuple(-15.0 + 2.0 * ring for ring in range(16))
HDL64E_ELEVATIONS_DEG = (
    *(-24.33 + 0.5 * ring for ring in range(32)),  # lower block: −24.33° to −8.83°
    *(-25.0 / 3.0 + ring / 3.0 for ring in range(32)),  # upper block: −8.33° to 2°
)

Elevation = Annotated[Number, Field(ge=-MAX_ELEVATION_DEG, le=MAX_ELEVATION_DEG)]


@dataclass(frozen=True, kw_only=True)
class SpinningLidar(Parameters, name="lidar"):
    """Rings and range model of a lidar; the defaults are those of a VLP-16 at 10 Hz.

    Attributes:
        elevations_deg: elevations of the rings, ascending.
        firings: number of firings per revolution, evenly spaced.
        rate_hz: revolutions per second.
        range_min_m, range_max_m: limits; nearer and farther hits give no point.
        step_m: step that ranges are rounded to; 0: no rounding.
        sigma_m: standard deviation of a range, normally distributed.
        seed: seed of all of the device's noise.

    Raises:
        OpticsError: the message names the parameter, its value and the expected value.
    """

    elevations_deg: Annotated[tuple[Elevation, ...], Field(min_length=1, max_length=MAX_RINGS)] = (
        VLP16_ELEVATIONS_DEG
    )
    firings: Annotated[int, Field(strict=True, ge=8, le=MAX_FIRINGS)] = 1800
    rate_hz: Annotated[Number, Field(ge=0.01, le=1000.0)] = 10.0
    range_min_m: NotNegative = 0.5
    range_max_m: Positive = 100.0
    step_m: NotNegative = 0.002
    sigma_m: NotNegative = 0.03
    seed: Seed = 0

    def __repr__(self) -> str:
        rings = f"{self.rings} rings × {self.firings} firings at {self.rate_hz:g} Hz"
        return short_repr(self, rings, f"{self.range_min_m:g} to {self.range_max_m:g} m")

    def summary(self) -> str:
        """Rings, firings and range."""
        rings = f"{self.rings} rings × {self.firings} firings at {self.rate_hz:g} Hz"
        return f"{rings} to {self.range_max_m:g} m"

    def open(self, stage: SharedScene, mounting: Mounting) -> LidarRenderer:
        """Open a renderer of point clouds on a stage."""
        return LidarRenderer(stage, self, mounting)

    def _check(self) -> None:
        if any(np.diff(self.elevations_deg) <= 0.0):
            raise self._error("elevations_deg", "rising angles")
        if self.range_min_m >= self.range_max_m:
            raise self._error("range_min_m", f"less than range_max_m = {self.range_max_m:g}")

    @classmethod
    def vlp16(cls) -> SpinningLidar:
        """A Velodyne VLP-16 at 10 Hz.

        Source: Velodyne, VLP-16 User Manual, 63-9243 Rev. D: 16 lasers 2° apart, 0.2° at 10 Hz,
        100 m, steps of 2 mm. Its typical accuracy of ±3 cm is taken as the standard deviation; the
        minimum range is an assumption.
        """
        return cls()

    @classmethod
    def hdl64e(cls) -> SpinningLidar:
        """A Velodyne HDL-64E S2 at 10 Hz.

        Source: Velodyne, HDL-64E S2 User's Manual, specifications: 32 lasers 1/3° apart above 32
        that are 1/2° apart, 120 m, less than 2 cm (one sigma), steps of 2 mm. 2083 firings are
        0.173° apart. Values that could not be checked are assumptions, such as the minimum range.
        """
        return cls(
            elevations_deg=HDL64E_ELEVATIONS_DEG,
            firings=2083,
            range_min_m=0.9,
            range_max_m=120.0,
            sigma_m=0.02,
        )

    def without_noise(self) -> SpinningLidar:
        """The same lidar without noise; it still rounds."""
        return dataclasses.replace(self, sigma_m=0.0)

    def without_errors(self) -> SpinningLidar:
        """The same lidar without noise and without rounding."""
        return dataclasses.replace(self.without_noise(), step_m=0.0)

    @property
    def rings(self) -> int:
        """Number of rings."""
        return len(self.elevations_deg)

    @property
    def period_s(self) -> float:
        """Duration of a revolution in seconds."""
        return 1.0 / self.rate_hz

    @property
    def reach_m(self) -> float:
        """Range beyond which no noise brings a surface back into range."""
        return self.range_max_m + self.step_m + 10.0 * self.sigma_m  # once in 1e23 points

    @cached_property
    def azimuths_rad(self) -> NDArray[np.float64]:
        """Azimuths (firings,) from straight ahead, counter-clockwise: descending from π."""
        return math.pi - 2.0 * math.pi * np.arange(self.firings, dtype=np.float64) / self.firings

    @cached_property
    def times_s(self) -> NDArray[np.float64]:
        """Times (firings,) of the firings after the revolution's start, seconds."""
        return np.arange(self.firings, dtype=np.float64) * (self.period_s / self.firings)

    @cached_property
    def beams(self) -> LidarBeams:
        """Directions of the beams."""
        return LidarBeams(np.radians(self.elevations_deg), self.azimuths_rad, self.reach_m)

    def measure(self, true_ranges_m: NDArray[np.floating], revolution: int) -> NDArray[np.float64]:
        """Measured ranges (rings, firings) in meters; +inf: no return.

        The noise depends only on the seed and the numbers of revolution, ring and firing, so that
        any revolution of a drive can be repeated alone.

        Args:
            true_ranges_m: (rings, firings), +inf for a miss.
            revolution: number of the revolution; equal numbers give equal noise.

        Raises:
            OpticsError: a revolution that is not a whole number of 32 bits.
        """
        check_number("lidar: revolution", revolution)
        ranges_m = np.array(true_ranges_m, dtype=np.float64)
        if self.sigma_m:
            random = np.random.default_rng((self.seed, revolution))
            ranges_m += self.sigma_m * random.standard_normal(ranges_m.shape)
        ranges_m = rounded(ranges_m, self.step_m)
        ranges_m[(ranges_m < self.range_min_m) | (ranges_m > self.range_max_m)] = np.inf
        return ranges_m

    def points(
        self, ranges_m: NDArray[np.float64], instances: NDArray[np.uint32]
    ) -> NDArray[np.void]:
        """Points (n,) from measured ranges (rings, firings), +inf for none, and instances."""
        firings, rings = np.nonzero(np.isfinite(ranges_m.T))
        points = np.empty(len(rings), dtype=POINT)
        ranges = ranges_m[rings, firings]
        xyz = ranges[:, None] * self.beams.directions[rings, firings]
        for axis, values in zip("xyz", xyz.T, strict=True):
            points[axis] = values
        points["ring"], points["range"] = rings, ranges
        points["time"], points["azimuth"] = self.times_s[firings], self.azimuths_rad[firings]
        points["instance"] = instances[rings, firings]
        return points


@dataclass(frozen=True, eq=False)
class PointCloud:
    """Points of one revolution, in the order in which they are measured.

    Attributes:
        points: (n,) of type `POINT`: meters in the lidar's frame at each point's own time, ring,
            seconds since the revolution's start, azimuth in radians counter-clockwise, range in
            meters, and instance ID as in ground truth.
        lidar: lidar that measured them.
        world_from_lidar_at_start, world_from_lidar: (4, 4) poses of the lidar at the revolution's
            start and end.
        metadata: omnisim's version, the scene, number and end of the revolution.
    """

    points: NDArray[np.void]
    lidar: SpinningLidar
    world_from_lidar_at_start: NDArray[np.float64]
    world_from_lidar: NDArray[np.float64]
    metadata: dict[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        return short_repr(self, f"{len(self.points)} points", f"{self.lidar.rings} rings")

    @property
    def points_m(self) -> NDArray[np.float32]:
        """Points (n, 3) in the lidar's frame at each point's own time."""
        return np.stack([self.points[axis] for axis in "xyz"], axis=-1)

    def save(self, path: str | Path) -> None:
        """Write the point cloud in the format of the suffix, .ply or .pcd; atomically.

        Comments of the header are `key: value` with JSON values: the metadata, the lidar's
        parameters, and its poses by rows.

        Raises:
            OutputError: the file cannot be written.
            KeyError: another suffix.
        """
        comments = {
            **self.metadata,
            **dataclasses.asdict(self.lidar),
            "world_from_lidar_at_start": self.world_from_lidar_at_start.tolist(),
            "world_from_lidar": self.world_from_lidar.tolist(),
        }
        write_points(Path(path), self.points, self.world_from_lidar, comments)


class LidarRenderer(SensorRenderer[SpinningLidar, BeamCaster]):
    """Renderer of a lidar's point clouds of a scene."""

    def __init__(self, stage: SharedScene, sensor: SpinningLidar, mounting: Mounting):
        super().__init__(stage, sensor, mounting)
        self._labels = LabelCache()
        self._boxes = MovingBoxes(self.scene, stage.objects.values())

    def _open_passes(self, hidden: frozenset[ObjectPart]) -> BeamCaster:
        return self._stage.backend.beam_caster(self.sensor.beams, hidden)

    def scan(
        self, motion: Motion | WorldState | ArrayLike, time_s: float = 0.0, revolution: int = 0
    ) -> PointCloud:
        """Measure the point cloud of the revolution that ends at a time.

        Args:
            motion: world states by time in seconds, or poses (4, 4) of the vehicle if nothing else
                moves; or a single state or pose, at rest.
            time_s: end of the revolution.
            revolution: number of the revolution in its drive; the noise depends on it and the
                lidar's seed only.

        Raises:
            OmnisimError: an invalid pose, an object without a pose, an invalid number, a vehicle
                that turns too fast, or the renderer or its stage is closed.
        """

        def poses_at(at_s: float) -> LidarPoses:
            state = self._state(motion(at_s) if callable(motion) else motion)
            return LidarPoses(self._world_from_sensor(state), self._stage.poses_in(state))

        lidar, stage = self.sensor, self._stage
        start_s = time_s - lidar.period_s
        with self._current() as caster:
            plan = plan_revolution(lidar.firings, lidar.period_s, poses_at, start_s, self._boxes)
            hits = caster.cast(plan)
            draws = caster.draws
        labels = self._labels.find(stage.scene, stage.objects, tuple(stage.vehicles))
        instances = instances_of_draws(labels, draws, list(stage.objects))
        ranges_m = lidar.measure(hits.ranges_m, revolution)
        return PointCloud(
            lidar.points(ranges_m, instances.take(hits.draw_ids)),
            lidar,
            plan.slices[0].start.world_from_lidar,
            plan.slices[-1].end.world_from_lidar,
            self._metadata(revolution=int(revolution), time_s=float(time_s)),
        )
