"""Spinning 3-D lidars: rings, limits, noise and point clouds.

The lidar's frame has x forward, y left and z up (REP 103). All lasers start at its origin, and ring
0 has the lowest elevation, as in ROS's drivers. The head turns clockwise as seen from above, as in
Velodyne's lidars, and a revolution begins straight behind. All rings fire simultaneously and in
one azimuth, with one return per laser. Three effects of real devices are not modeled: their lasers
fire within 46 µs, their lenses are centimeters apart, and a beam on two surfaces has two returns.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
import scipy  # its submodules load when first used
from numpy.typing import ArrayLike, NDArray
from pydantic import Field

from omnisim.core.arrays import Floats, Floats32, Indices
from omnisim.core.errors import OmnisimError
from omnisim.core.files import parameters
from omnisim.core.pending import Pending
from omnisim.core.rate import LATE
from omnisim.core.short_repr import short_repr
from omnisim.core.world import Motion, ObjectPart, WorldState
from omnisim.ground_truth.hits import EchoLimits, LidarBeams, LidarPoses, Revolution, Slice
from omnisim.rendering.contract import BeamCaster, LabelCache
from omnisim.rendering.instrument import Instrument
from omnisim.rendering.sensor import Moment, Mount, SensorSettings
from omnisim.rendering.shared_scene import SharedScene
from omnisim.rendering.truth import instances_of_draws
from omnisim.rendering.twist import MovingBoxes
from omnisim.sensors.device_data import check_number, round_ranges, stated_parameters
from omnisim.sensors.lidar.point_files import POINT, write_points
from omnisim.sensors.sensor_table import Rate, SensorTable

MAX_RINGS, MAX_FIRINGS = 1024, 16384
MAX_ELEVATION_DEG = 80.0
STATES = 16  # number of recorded true states per revolution
VLP16_ELEVATIONS_DEG = tuple(-15.0 + 2.0 * ring for ring in range(16))
HDL64E_ELEVATIONS_DEG = (
    *(-24.33 + 0.5 * ring for ring in range(32)),  # lower block: −24.33° to −8.83°
    *(-25.0 / 3.0 + ring / 3.0 for ring in range(32)),  # upper block: −8.33° to 2°
)

Returns = Annotated[int, Field(strict=True, ge=1, le=2)]
Elevation = Annotated[parameters.Number, Field(ge=-MAX_ELEVATION_DEG, le=MAX_ELEVATION_DEG)]


@dataclass(frozen=True, kw_only=True)
class SpinningLidar(parameters.Parameters, SensorSettings, name="lidar"):
    """Rings and range model of a lidar; the default is a VLP-16 at 10 revolutions per second."""

    elevations_deg: Annotated[tuple[Elevation, ...], Field(min_length=1, max_length=MAX_RINGS)] = (
        VLP16_ELEVATIONS_DEG
    )
    """Elevation per ring in degrees above the lidar's x-y plane, ascending. Default here and for
    all further keys: the device's value."""
    firings: Annotated[int, Field(strict=True, ge=8, le=MAX_FIRINGS)] = 1800
    """Firings of all rings per revolution, evenly spaced; 1800 are 0.2° apart."""
    rate_hz: Annotated[parameters.Number, Field(ge=0.01, le=1000.0)] = 10.0
    """Revolutions per second."""
    range_min_m: parameters.NotNegative = 0.5
    """Minimum range in meters; nearer hits give no point."""
    range_max_m: parameters.Positive = 100.0
    """Maximum range in meters; farther hits give no point."""
    step_m: parameters.NotNegative = 0.002
    """Ranges are rounded to multiples of this step in meters; 0: no rounding."""
    sigma_m: parameters.NotNegative = 0.03
    """Standard deviation of a range's normally distributed error in meters."""
    seed: parameters.Seed = 0
    """Seed of the device, which determines its noise."""
    specular: parameters.Flag = True
    """True: beams pass panes and are reflected by mirrors, in scenes with such materials; false:
    they end at the first surface."""
    returns: Returns = 1
    """Returns per beam behind glass and mirrors: 1, the strongest; or 2, the strongest and the
    last, or the second strongest."""
    min_intensity: parameters.Fraction = 0.1
    """Faintest return at the maximum range from specular surfaces, and from what is behind them; 1
    is a white surface met perpendicularly. Nearer returns may be fainter by the squared range. An
    assumption."""
    file_format: Literal["ply", "pcd"] = "ply"
    """Binary format of the point clouds: PLY, or PCD of the Point Cloud Library."""

    noun: ClassVar[str] = "lidar"
    suffixes: ClassVar[tuple[str, ...]] = (".ply", ".pcd")
    has_instances: ClassVar[bool] = True

    def __repr__(self) -> str:
        rings = f"{self.rings} rings × {self.firings} firings at {self.rate_hz:g} Hz"
        return short_repr(self, rings, f"{self.range_min_m:g} to {self.range_max_m:g} m")

    def summary(self) -> str:
        """Short description: rings, firings and range."""
        rings = f"{self.rings} rings × {self.firings} firings at {self.rate_hz:g} Hz"
        return f"{rings} to {self.range_max_m:g} m"

    def open(self, stage: SharedScene, mount: Mount[object]) -> LidarRenderer:
        """Open a renderer of point clouds on a stage."""
        return LidarRenderer(stage, self, mount)

    def state_times_s(self, times_s: Floats) -> Floats:
        """Times (m,) within all revolutions, dense enough for removing a cloud's skew."""
        since_s = np.arange(STATES) / (STATES * self.rate_hz)
        return (times_s[:, None] - since_s).ravel()

    def note(self, mount: Mount[object], times_s: Floats) -> str | None:
        """Notice that revolutions between the steps have no cloud; None if all have one."""
        turns = int(float(np.ptp(times_s)) * self.rate_hz + LATE) + 1
        if mount.rate is not None or turns <= len(times_s):
            return None
        return (
            f"{mount.name}: one cloud per step, of {len(times_s)} of the lidar's {turns} "
            f"revolutions: rate_hz = {self.rate_hz:g} in its table records all"
        )

    def manifest(self, mount: Mount[object]) -> dict[str, Any]:
        """Setting with the format of the point clouds."""
        return {"file_format": self.file_format}

    @classmethod
    def suffixes_of(cls, manifest: Mapping[str, Any]) -> tuple[str, ...]:
        """Suffix of the run's point clouds."""
        return (f".{manifest['file_format']}",)

    def _check(self) -> None:
        if any(np.diff(self.elevations_deg) <= 0.0):
            raise self._error("elevations_deg", "rising angles")
        if self.range_min_m >= self.range_max_m:
            raise self._error("range_min_m", f"less than range_max_m = {self.range_max_m:g}")

    @classmethod
    def vlp16(cls) -> SpinningLidar:
        """Velodyne VLP-16 at 10 Hz.

        Its typical accuracy of ±3 cm is used as the standard deviation; the minimum range is an
        assumption.

        Source: Velodyne, VLP-16 User Manual, 63-9243 Rev. D: 16 lasers 2° apart, 0.2° at 10 Hz,
        100 m, steps of 2 mm.
        """
        return cls()

    @classmethod
    def hdl64e(cls) -> SpinningLidar:
        """Velodyne HDL-64E S2 at 10 Hz.

        Its 2083 firings are 0.173° apart. Values without a verified source are assumptions, above
        all the minimum range.

        Source: Velodyne, HDL-64E S2 User's Manual, specifications: 32 lasers 1/3° apart above 32
        that are 1/2° apart, 120 m, less than 2 cm (one sigma), steps of 2 mm.
        """
        return cls(
            elevations_deg=HDL64E_ELEVATIONS_DEG,
            firings=2083,
            range_min_m=0.9,
            range_max_m=120.0,
            sigma_m=0.02,
        )

    def without_noise(self) -> SpinningLidar:
        """Copy of the lidar without noise; ranges are still rounded."""
        return dataclasses.replace(self, sigma_m=0.0)

    def without_errors(self) -> SpinningLidar:
        """Copy of the lidar without noise and rounding."""
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
        """Range beyond which noise brings no surface back into range."""
        return self.range_max_m + self.step_m + 10.0 * self.sigma_m  # exceeded once in 1e23 points

    @cached_property
    def azimuths_rad(self) -> Floats:
        """Azimuths (firings,) counter-clockwise from straight ahead, descending from π."""
        return math.pi - 2.0 * math.pi * np.arange(self.firings, dtype=np.float64) / self.firings

    @cached_property
    def times_s(self) -> Floats:
        """Times (firings,) of the firings since the revolution's start."""
        return np.arange(self.firings, dtype=np.float64) * (self.period_s / self.firings)

    @cached_property
    def beams(self) -> LidarBeams:
        """Directions of all beams."""
        limits = EchoLimits(self.returns, self.min_intensity, self.range_max_m)
        return LidarBeams(
            np.radians(self.elevations_deg),
            self.azimuths_rad,
            self.reach_m,
            limits if self.specular else None,
        )

    def measure(
        self, true_ranges_m: NDArray[np.floating], revolution: int, number: int = 0
    ) -> Floats:
        """Simulate measured ranges (rings, firings) in meters; +inf: no return.

        The noise depends only on the seed, the revolution's number, the ring and the firing, so any
        revolution of a drive can be reproduced separately.

        Args:
            true_ranges_m: (rings, firings) true ranges, +inf for misses.
            revolution: index of the revolution; equal numbers have equal noise.
            number: index of the return.

        Raises:
            OpticsError: the index is not a whole number of 32 bits.
        """
        check_number("lidar: revolution", revolution)
        ranges_m = np.array(true_ranges_m, dtype=np.float64)
        if self.sigma_m:
            seeds = (self.seed, revolution, number) if number else (self.seed, revolution)
            random = np.random.default_rng(seeds)
            ranges_m += self.sigma_m * random.standard_normal(ranges_m.shape)
        ranges_m = round_ranges(ranges_m, self.step_m)
        ranges_m[(ranges_m < self.range_min_m) | (ranges_m > self.range_max_m)] = np.inf
        return ranges_m

    def points(
        self, ranges_m: Floats, instances: NDArray[np.uint32], intensities: NDArray[np.floating]
    ) -> NDArray[np.void]:
        """Points (n,) of beams, in the order of measurement.

        Ranges, +inf for misses, instance IDs and intensities are (rings, firings) or (returns,
        rings, firings).
        """
        shape = (-1, self.rings, self.firings)
        ranges_m, instances = ranges_m.reshape(shape), instances.reshape(shape)
        firings, rings, returns = np.nonzero(np.isfinite(ranges_m.T))
        points = np.empty(len(rings), dtype=POINT)
        beams = returns, rings, firings
        ranges = ranges_m[beams]
        xyz = ranges[:, None] * self.beams.directions[rings, firings]
        for axis, values in zip("xyz", xyz.T, strict=True):
            points[axis] = values
        points["ring"], points["range"] = rings, ranges
        points["time"], points["azimuth"] = self.times_s[firings], self.azimuths_rad[firings]
        points["instance"] = instances[beams]
        points["intensity"] = intensities.reshape(shape)[beams]
        points["return"] = 1 + returns
        return points


@dataclass(frozen=True, eq=False)
class PointCloud:
    """Point cloud of one revolution, in the order of measurement.

    Attributes:
        points: (n,) points of type `POINT`: position in meters in the lidar's frame at the point's
            own time, ring number, seconds since the revolution's start, azimuth in radians
            counter-clockwise, range in meters, instance ID as in the ground truth, intensity, 1 for
            a white surface met perpendicularly at the same range, and number of the return, from 1.
        lidar: lidar of the cloud.
        world_from_lidar_at_start, world_from_lidar: (4, 4) lidar poses at the start and the end of
            the revolution.
        metadata: omnisim's version, the scene, and the revolution's number and end time.
    """

    points: NDArray[np.void]
    lidar: SpinningLidar
    world_from_lidar_at_start: Floats
    world_from_lidar: Floats
    metadata: dict[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        return short_repr(self, f"{len(self.points)} points", f"{self.lidar.rings} rings")

    @property
    def points_m(self) -> Floats32:
        """Points (n, 3) in the lidar's frame, each at its own time."""
        return np.stack([self.points[axis] for axis in "xyz"], axis=-1)

    def save(self, path: str | Path) -> None:
        """Atomically write the cloud in the format of the path's suffix, .ply or .pcd.

        Without a suffix, the lidar's `file_format` is taken.

        The header's comments hold `key: value` lines with JSON values: the metadata, the lidar's
        parameters, and its poses row by row.

        Raises:
            OutputError: the file cannot be written.
            KeyError: any other suffix.
        """
        comments = {
            **self.metadata,
            **stated_parameters(self.lidar),
            "world_from_lidar_at_start": self.world_from_lidar_at_start.tolist(),
            "world_from_lidar": self.world_from_lidar.tolist(),
        }
        target = Path(path)
        target = target if target.suffix else target.with_suffix(f".{self.lidar.file_format}")
        write_points(target, self.points, self.world_from_lidar, comments)


class LidarRenderer(Instrument[SpinningLidar, BeamCaster, PointCloud]):
    """Renders a lidar's point clouds of a scene."""

    def __init__(self, stage: SharedScene, sensor: SpinningLidar, mount: Mount[object]):
        super().__init__(stage, sensor, mount)
        self._labels = LabelCache()
        self._boxes = MovingBoxes(self.scene, stage.objects.values())

    def _open_passes(self, hidden: frozenset[ObjectPart]) -> BeamCaster:
        return self._stage.backend.beam_caster(self.sensor.beams, hidden)

    def begin(self, moment: Moment) -> Pending[PointCloud]:
        """Render the cloud of the revolution that ends at a moment."""
        return Pending.done(self.scan(moment.motion, moment.time_s, moment.number))

    def scan(
        self, motion: Motion | WorldState | ArrayLike, time_s: float = 0.0, revolution: int = 0
    ) -> PointCloud:
        """Render the point cloud of the revolution that ends at a time.

        Args:
            motion: function from seconds to the state of the world, or to the vehicle's (4, 4) pose
                if nothing else moves; a constant state or pose is allowed as well.
            time_s: end time of the revolution.
            revolution: index of the revolution in the drive; with the lidar's seed it determines
                the noise.

        Raises:
            OmnisimError: an invalid pose, an object without a pose, an invalid index, a vehicle
                that turns too fast, or a closed renderer or stage.
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
        returns = [hits] if hits.second is None else [hits, hits.second]
        ranges_m = [
            lidar.measure(echo.ranges_m, revolution, number) for number, echo in enumerate(returns)
        ]
        intensities = np.stack(
            [echo.intensities for echo in returns if echo.intensities is not None]
        )
        return PointCloud(
            lidar.points(
                np.stack(ranges_m),
                np.stack([instances.take(echo.draw_ids) for echo in returns]),
                intensities,
            ),
            lidar,
            plan.slices[0].start.world_from_lidar,
            plan.slices[-1].end.world_from_lidar,
            self._metadata(revolution=int(revolution), time_s=float(time_s)),
        )


DEVICES = {"vlp16": SpinningLidar.vlp16, "hdl64e": SpinningLidar.hdl64e}


@parameters.overriding(SpinningLidar)
class LidarTable(SensorTable):
    """Spinning 3-D lidar; missing keys default to the device's values."""

    sensor_class: ClassVar[type[SensorSettings]] = SpinningLidar

    type: Literal["lidar"]
    device: Literal["vlp16", "hdl64e"] = "vlp16"
    """Velodyne's VLP-16 (16 rings, ±15°) or HDL-64E S2 (64 rings, −24.3° to 2°)."""
    noise: parameters.Flag = True
    """True: the device's noise; false: ranges are exact except for rounding."""
    file_format: Literal["ply", "pcd"] = "ply"
    """Binary format of the point clouds: PLY, or PCD of the Point Cloud Library."""
    rate_hz: Rate | None = None
    """Revolutions per second, with one cloud each. Default: the device's, with a cloud per step."""

    def sensor(self) -> SpinningLidar:
        """Build the lidar's settings."""
        lidar = self.overriding(DEVICES[self.device]())
        return lidar if self.noise else lidar.without_noise()


# Motion of a lidar and of dynamic objects during a revolution.


SLICES = (8, 16, 32, 64)  # candidate numbers of slices of a revolution with motion
# Maximum motion of the lidar and of objects within a slice. A firing's hit then lies within one
# texel of the view from the slice's middle, except on grazed surfaces.
MAX_PATH_M, MAX_TURN_RAD = 0.01, 0.06
# Points move straight within a slice. This bounds their distance from the true path in its middle.
MAX_SKEW_M = 1e-4

PosesAt = Callable[[float], LidarPoses]


def plan_revolution(
    firings: int, period_s: float, poses_at: PosesAt, start_s: float, boxes: MovingBoxes
) -> Revolution:
    """Cut a revolution into slices that are short enough; a static one is a single slice.

    It starts at `start_s`; `boxes` are those of all moving objects.

    Raises:
        OmnisimError: the lidar turns too fast.
    """
    ends = [poses_at(start_s + share * period_s) for share in (0.0, 0.3, 0.7, 1.0)]
    if all(_is_same(ends[0], part, boxes) for part in ends[1:]):
        whole = Slice(0, firings, ends[0], ends[0], ends[0])
        return _revolution(firings, (whole,))
    for count in SLICES:
        slices = _cut(firings, period_s, poses_at, start_s, count)
        if all(_is_short(part, boxes) for part in slices):
            break
    turn_rad = max(_turn_rad(part) for part in slices)
    if turn_rad > MAX_TURN_RAD:
        raise OmnisimError(
            f"lidar: expected a turn of at most {MAX_TURN_RAD:g} rad in 1/{count} of a "
            f"revolution, got {turn_rad:g}"
        )
    return _revolution(firings, slices)


def _cut(
    firings: int, period_s: float, poses_at: PosesAt, start_s: float, count: int
) -> tuple[Slice, ...]:
    """Cut a revolution into about `count` slices."""
    width = -(-firings // count)
    bounds = [*range(0, firings, width), firings]
    step_s = 0.5 * period_s / firings  # half a firing period
    halves = [a + b for a, b in itertools.pairwise(bounds)]
    times = sorted([2 * bound for bound in bounds] + halves)
    poses = [poses_at(start_s + step_s * time) for time in times]
    return tuple(
        Slice(bounds[i], bounds[i + 1], *poses[2 * i : 2 * i + 3]) for i in range(len(bounds) - 1)
    )


def _revolution(count: int, slices: tuple[Slice, ...]) -> Revolution:
    firings = np.arange(count)
    width = slices[0].last
    index = firings // width
    first = np.array([part.first for part in slices])[index]
    shares = (firings - first) / np.array([part.last - part.first for part in slices])[index]
    if len(slices) == 1 and slices[0].start is slices[0].end:
        rotation = slices[0].start.world_from_lidar[:3, :3]
        return Revolution(slices, shares, np.broadcast_to(rotation, (count, 3, 3)))
    poses = [pose for part in slices for pose in (part.start, part.middle)] + [slices[-1].end]
    knots = np.stack([pose.world_from_lidar[:3, :3] for pose in poses])
    half = 2 * index + (shares >= 0.5)
    return Revolution(slices, shares, _rotations(knots, half, 2.0 * shares % 1.0))


def _rotations(knots: Floats, index: Indices, share: Floats) -> Floats:
    """Slerp between knots (k, 3, 3): rotations (n, 3, 3) at fractions `share` (n,) past `index`."""
    rotation = scipy.spatial.transform.Rotation
    changes = np.swapaxes(knots[:-1], 1, 2) @ knots[1:]
    vectors = rotation.from_matrix(changes).as_rotvec()
    turned = rotation.from_rotvec(share[:, None] * vectors[index]).as_matrix()
    return knots[index] @ turned


def _is_same(part: LidarPoses, other: LidarPoses, boxes: MovingBoxes) -> bool:
    pairs = zip(
        (part.world_from_lidar, *boxes.poses(part.world_from_objects)),
        (other.world_from_lidar, *boxes.poses(other.world_from_objects)),
        strict=True,
    )
    return all(np.array_equal(a, b) for a, b in pairs)


def _is_short(part: Slice, boxes: MovingBoxes) -> bool:
    """True if the motion within a slice is within the limits."""
    moving = [(np.zeros((1, 3)), *(pose.world_from_lidar for pose in _poses(part)))]
    moved = (boxes.poses(pose.world_from_objects) for pose in _poses(part))
    moving += zip(boxes.corners_m, *moved, strict=True)
    if _turn_rad(part) > MAX_TURN_RAD:
        return False
    for corners_m, *poses in moving:
        start, middle, end = (corners_m @ pose[:3, :3].T + pose[:3, 3] for pose in poses)
        if np.linalg.norm(end - start, axis=1).max(initial=0.0) > MAX_PATH_M:
            return False
        error_m = middle - 0.5 * (start + end)
        if np.linalg.norm(error_m, axis=1).max(initial=0.0) > MAX_SKEW_M:
            return False
    return True


def _poses(part: Slice) -> tuple[LidarPoses, LidarPoses, LidarPoses]:
    return part.start, part.middle, part.end


def _turn_rad(part: Slice) -> float:
    """Angle by which the lidar turns during a slice."""
    start, end = part.start.world_from_lidar[:3, :3], part.end.world_from_lidar[:3, :3]
    # the chord between two rotations is accurate for small angles as well
    chord = float(np.linalg.norm(end - start)) / np.sqrt(8.0)
    return float(2.0 * np.arcsin(min(chord, 1.0)))
