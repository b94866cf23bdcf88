"""Sensors on vehicles: settings, mounts, and the moments and readings of measurements.

A sensor is frozen settings. A stage opens it at a mount as an instrument
(`omnisim.rendering.instrument`), whose readings save themselves:

    with stage.open(SpinningLidar(), base_from_sensor) as instrument:
        instrument.measure(moment).save(Path("run/lidar/000000"))  # run/lidar/000000.ply
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Generic, Protocol, TypeGuard, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from omnisim.core import poses
from omnisim.core.arrays import Floats
from omnisim.core.files.parameters import Coordinate, Number, Table
from omnisim.core.short_repr import short_repr
from omnisim.core.world import Motion, WorldState

if TYPE_CHECKING:  # slow to import, and not needed by cameras without a vehicle
    from omnisim.core.pending import Pending
    from omnisim.core.rate import SensorRate
    from omnisim.core.trajectories import Trajectory
    from omnisim.core.trajectories.body_motion import BodyMotion

TABLE_SUFFIX = ".csv"
SensorT = TypeVar("SensorT")
SensorT_co = TypeVar("SensorT_co", covariant=True)


class Reading(Protocol):
    """Measured values: arrays, with units in their names, that save themselves."""

    @property
    def metadata(self) -> dict[str, Any]:
        """omnisim's version, the scene and the number of the measurement, as JSON values."""

    def save(self, stem: Path) -> None:
        """Write the files of the measurement.

        Args:
            stem: path of the files without suffix.

        Raises:
            OutputError: a file cannot be written.
        """


@dataclass(frozen=True, eq=False)
class Moment:
    """Time and context of one measurement of a sensor.

    Attributes:
        motion: function from seconds to states of the world, or to poses (4, 4) of the vehicle.
        number: index of the measurement, from 0; the step, for a sensor without its own rate.
        time_s: time of the measurement.
        previous_s, next_s: times of the neighboring measurements; None: no such measurement.
        channels: ground-truth channels to record.
        previous_stem: path, without suffix, of the previous measurement's files; None: no previous
            measurement.
        previous: the previous measurement, whose files may not be written yet; None: they are.
    """

    motion: Motion
    number: int = 0
    time_s: float = 0.0
    previous_s: float | None = None
    next_s: float | None = None
    channels: tuple[str, ...] = ()
    previous_stem: Path | None = None
    previous: Pending[Reading] | None = None

    def __repr__(self) -> str:
        return short_repr(self, f"step {self.number}", f"{self.time_s:g} s")

    @classmethod
    def at_rest(cls, state: WorldState | ArrayLike, number: int = 0) -> Moment:
        """Moment in a world at rest, in a state or with the vehicle at a pose (4, 4)."""
        if isinstance(state, WorldState):
            return cls(lambda _: state, number, state.time_s)
        pose = np.asarray(state)
        return cls(lambda _: pose, number)


@dataclass(frozen=True, eq=False)
class Mount(Generic[SensorT_co]):
    """Sensor on a vehicle: its place there, its timing, and what a drive asks of it.

    Attributes:
        sensor: settings of the sensor.
        name: unique name among the vehicle's sensors.
        type: sensor type in the robot file.
        base_from_sensor: (4, 4) pose on the vehicle; the sensor looks along x. A camera's own
            `base_from_rig` follows it; that of a robot's cameras includes the mount.
        hides: names of instances of the body that it does not see, such as its own housing.
        rate: own rate; None: one measurement per step of the drive.
        time_shift_s: offset from a measurement's stamp to its time; for cameras.
        vehicle: name of the vehicle in the world; None: the stage's first.
        seed: noise seed of sensors without their own.
        unlit: show plain base colors; for cameras.
        channel_format: file format of the ground truth, a `ChannelFormat`.
        boxes_3d: also record the oriented boxes of the visible instances.
    """

    sensor: SensorT_co
    name: str = ""
    type: str = ""
    base_from_sensor: Floats = field(default_factory=lambda: np.eye(4))
    hides: tuple[str, ...] = ()
    rate: SensorRate | None = None
    time_shift_s: float = 0.0
    vehicle: str | None = None
    seed: int | str = 0
    unlit: bool = False
    channel_format: str = "auto"
    boxes_3d: bool = False

    def __repr__(self) -> str:
        return short_repr(self, repr(self.name), repr(self.sensor))

    @property
    def origin_m(self: Mount[SensorSettings]) -> Floats:
        """Origin (3,) of the sensor's rays in the base."""
        return self.sensor.origin_m(self.base_from_sensor)

    def summary(self: Mount[SensorSettings]) -> str:
        """Short description of the sensor."""
        return self.sensor.summary()

    def times_s(self, step_times_s: Floats, seed: int) -> Floats:
        """Times (n,) of the measurements in a drive with steps at times (m,).

        Raises:
            RunError: no measurement falls into the drive, or there are too many for memory.
        """
        if self.rate is None:
            return step_times_s
        start_s, end_s = step_times_s[[0, -1]].tolist()
        return self.rate.times_s(start_s, end_s, seed, self.name)


def carries(mount: Mount[object], kind: type[SensorT]) -> TypeGuard[Mount[SensorT]]:
    """True if a mount carries a sensor of a class."""
    return isinstance(mount.sensor, kind)


class SensorSettings(ABC):
    """Base of all sensors' settings: how a vehicle carries them, and their files in a run.

    Only `summary` is required. A sensor that sees also has `open`, see `omnisim.rendering.stage`.

    Attributes:
        noun: type of sensor in messages and labels.
        origin_noun: name of the point at the mount's position in messages.
        suffixes: suffixes of all possible files of a step; `*` matches any letters.
        document_names: names of its files per run.
        has_ground_truth: True if its files include channels of ground truth.
        has_instances: True if its files use the instance IDs of the run's labels.
        specular: True if it follows panes and mirrors.
    """

    noun: ClassVar[str] = "sensor"
    origin_noun: ClassVar[str] = "origin"
    suffixes: ClassVar[tuple[str, ...]] = ()
    document_names: ClassVar[tuple[str, ...]] = ()
    has_ground_truth: ClassVar[bool] = False
    has_instances: ClassVar[bool] = False
    specular: bool = False

    def __repr__(self) -> str:
        return short_repr(self, self.summary())

    @abstractmethod
    def summary(self) -> str:
        """Short description of the sensor."""

    @property
    def near_m(self) -> float:
        """Minimum distance of visible surfaces; `math.inf` for sensors that do not see."""
        return 0.0

    def origin_m(self, base_from_sensor: Floats) -> Floats:
        """Origin (3,) of the rays in the base, for a mount at a pose (4, 4)."""
        return base_from_sensor[:3, 3]

    def state_times_s(self, times_s: Floats) -> Floats:
        """Times (m,) of the true states required by measurements at times (n,)."""
        return times_s

    @classmethod
    def suffixes_of(cls, manifest: Mapping[str, Any]) -> tuple[str, ...]:
        """Suffixes of the files of a step.

        Args:
            manifest: the sensor's own settings in the run's manifest, the run's `channel_format`
                and `boxes_3d`, and the `channels` of the step.
        """
        return cls.suffixes

    def manifest(self, mount: Mount[object]) -> dict[str, Any]:
        """JSON-serializable settings that the run's manifest lists."""
        return {}

    def documents(self, mount: Mount[object]) -> dict[str, str]:
        """Texts of the sensor's files per run, by file name."""
        return {}

    def write_readings(  # noqa: B027  # most sensors write a file per measurement instead
        self, folder: Path, mount: Mount[object], motion: BodyMotion, seed: int, times_s: Floats
    ) -> None:
        """Write the missing files that hold all measurements.

        Args:
            folder: folder of the sensor in the run.
            mount: mount of the sensor.
            motion: motion of the vehicle's base.
            seed: seed of the drive.
            times_s: (n,) times of the measurements.

        Raises:
            OutputError: a file cannot be written.
        """

    def check_trajectory(  # noqa: B027  # most sensors accept any trajectory
        self, mount: Mount[object], truth: Trajectory, times_s: Floats
    ) -> None:
        """Raise an error if the sensor cannot measure a trajectory at times (n,).

        Raises:
            RunError: the trajectory is unsuitable; names sensor, step and expected value.
        """

    def note(self, mount: Mount[object], times_s: Floats) -> str | None:
        """Notice on what measurements at times (n,) omit; None if they omit nothing."""
        return None


class MountingTable(Table):
    """Pose of the sensor on its vehicle; its position is that of the effective viewpoint."""

    position_m: tuple[Coordinate, Coordinate, Coordinate] = (0.0, 0.0, 0.0)
    """Meters in the base frame: x forward, y left, z up."""
    roll_deg: Number = 0.0
    """Degrees about x."""
    pitch_deg: Number = 0.0
    """Degrees about y; positive: nose down."""
    yaw_deg: Number = 0.0
    """Degrees about z, counter-clockwise seen from above."""

    @property
    def base_from_mount(self) -> Floats:
        """Pose (4, 4) on the vehicle."""
        return poses.pose(
            self.position_m, roll_deg=self.roll_deg, pitch_deg=self.pitch_deg, yaw_deg=self.yaw_deg
        )
