"""Protocol of sensors: mounted on a vehicle, opened on a stage, measuring the moving world.

sensor = MountedCamera(...)                    # from its table in the robot file
with sensor.instrument(stage, settings) as instrument:
    measurement = instrument.measure(moment)   # at a moment of the world's motion
measurement.save(Path("run/omnicam/000000"))   # run/omnicam/000000.png, ...
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from omnisim.core.files.atomic_file import is_written
from omnisim.core.short_repr import short_repr
from omnisim.core.trajectories import Trajectory
from omnisim.core.trajectories.body_motion import BodyMotion
from omnisim.core.world import Motion
from omnisim.ground_truth.npy import ChannelFormat
from omnisim.rendering.readback import Pending
from omnisim.rendering.sensor_renderer import Mounting
from omnisim.rendering.shared_scene import Closeable, SharedScene
from omnisim.rendering.stage import Stage
from omnisim.sensors.rate import SensorRate

TABLE_SUFFIX = ".csv"


@dataclass(frozen=True, eq=False)
class Moment:
    """Time and context of one measurement of a sensor.

    Attributes:
        motion: function from seconds to states of the world.
        number: index of the measurement, from 0; the step, for a sensor without its own rate.
        time_s: time of the measurement.
        previous_s, next_s: times of the neighboring measurements; None: no such measurement.
        channels: ground-truth channels to record.
        previous_stem: path, without suffix, of the previous measurement's files; None: no previous
            measurement.
        previous: the previous measurement, whose files may not be written yet; None: they are.
    """

    motion: Motion
    number: int
    time_s: float
    previous_s: float | None = None
    next_s: float | None = None
    channels: tuple[str, ...] = ()
    previous_stem: Path | None = None
    previous: Pending[Any] | None = None

    def __repr__(self) -> str:
        return short_repr(self, f"step {self.number}", f"{self.time_s:g} s")


class StepContent(NamedTuple):
    """Settings that determine the files of a sensor's step.

    Attributes:
        channels: ground-truth channels of the run.
        channel_format: file format of the run's channels.
        boxes_3d: True if the run records oriented boxes.
        settings: the sensor's own settings in the manifest.
    """

    channels: Collection[str]
    channel_format: ChannelFormat
    boxes_3d: bool
    settings: Mapping[str, Any]


@dataclass(frozen=True)
class DriveSettings:
    """Settings of a drive that apply to its sensors.

    Attributes:
        vehicle: name of the sensor's vehicle in the world.
        motion: motion of the vehicle's base.
        seed: seed of the drive.
        unlit: render plain base colors.
        channel_format: file format of the ground truth.
        boxes_3d: also record the oriented boxes of the visible instances.
    """

    vehicle: str
    motion: BodyMotion
    seed: int = 0
    unlit: bool = False
    channel_format: ChannelFormat = ChannelFormat.AUTO
    boxes_3d: bool = False


class Measurement(ABC):
    """Measurement of one sensor at one moment."""

    @abstractmethod
    def save(self, stem: Path) -> None:
        """Write the missing files of the measurement.

        Args:
            stem: output path without suffix.

        Raises:
            OutputError: a file cannot be written.
        """


@dataclass(frozen=True, eq=False)
class FileMeasurement(Measurement):
    """Measurement in a single file, such as a scan.

    Attributes:
        suffix: suffix of the file.
        write: function that writes the file to a path.
    """

    suffix: str
    write: Callable[[Path], None]

    def save(self, stem: Path) -> None:
        """Write the file unless it exists.

        Raises:
            OutputError: the file cannot be written.
        """
        target = stem.with_suffix(self.suffix)
        if not is_written(target):
            self.write(target)


class Instrument(Closeable):
    """Sensor that is open on a stage.

    Args:
        renderer: renderer that is closed with the instrument.
        begin: function that begins to measure the moving world at a moment.
    """

    def __init__(self, renderer: Closeable, begin: Callable[[Moment], Pending[Measurement]]):
        self._renderer, self._begin = renderer, begin

    def begin(self, moment: Moment) -> Pending[Measurement]:
        """Begin to measure, see `measure`; images are drawn until the result is requested."""
        return self._begin(moment)

    def measure(self, moment: Moment) -> Measurement:
        """Measure the moving world at a moment.

        Raises:
            RunError: the files of the previous step are damaged.
            OmnisimError: the instrument is closed.
        """
        return self._begin(moment).result()

    def close(self) -> None:
        """Close the renderer."""
        self._renderer.close()


@dataclass(frozen=True, eq=False)
class MountedSensor(ABC):
    """Sensor mounted on a vehicle.

    Attributes:
        type: sensor type in the robot file.
        name: unique name among the vehicle's sensors.
        hides: nodes of the body that are invisible to the sensor.
        sensor: parameters of the sensor.
        base_from_sensor: (4, 4) pose on the vehicle; the sensor looks along x. For a camera this is
            the identity; its pose is `base_from_rig`.
        rate: own rate; None: one measurement per step of the drive.
        noun: type of sensor in messages and labels.
        origin_noun: name of the point at the mount's position in messages.
        suffixes: suffixes of all possible files of a step; `*` matches any letters.
        document_names: names of its files per run.
        has_ground_truth: True if its files include channels of ground truth.
        has_instances: True if its files use the instance IDs of the run's labels.
    """

    type: str
    name: str
    hides: tuple[str, ...]
    sensor: Any
    base_from_sensor: NDArray[np.float64] = field(default_factory=lambda: np.eye(4))
    rate: SensorRate | None = field(default=None, kw_only=True)
    noun: ClassVar[str] = "sensor"
    origin_noun: ClassVar[str] = "origin"
    suffixes: ClassVar[tuple[str, ...]]
    document_names: ClassVar[tuple[str, ...]] = ()
    has_ground_truth: ClassVar[bool] = False
    has_instances: ClassVar[bool] = False

    def __repr__(self) -> str:
        return short_repr(self, repr(self.name), self.summary())

    @property
    def origin_m(self) -> NDArray[np.float64]:
        """Origin (3,) of the sensor's rays in the base."""
        return self.base_from_sensor[:3, 3]

    @property
    def near_m(self) -> float:
        """Minimum distance of visible surfaces; `math.inf` for sensors that do not see."""
        return 0.0

    def summary(self) -> str:
        """Short description of the sensor."""
        return self.sensor.summary()

    def times_s(self, step_times_s: NDArray[np.float64], seed: int) -> NDArray[np.float64]:
        """Times (n,) of the measurements in a drive with steps at times (m,).

        Raises:
            RunError: no measurement falls into the drive, or there are too many for memory.
        """
        if self.rate is None:
            return step_times_s
        start_s, end_s = step_times_s[[0, -1]].tolist()
        return self.rate.times_s(start_s, end_s, seed, self.name)

    def state_times_s(self, times_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Times (m,) of the true states required by measurements at times (n,)."""
        return times_s

    def instrument(self, stage: Stage, settings: DriveSettings) -> Instrument | None:
        """Open the sensor on a stage for a drive; None if it has no files per measurement.

        Raises:
            GraphicsError: sizes exceed the GPU's limits.
        """
        return None

    @classmethod
    def suffixes_of(cls, content: StepContent) -> tuple[str, ...]:
        """Suffixes of the files of a step."""
        return cls.suffixes

    def settings(self) -> dict[str, Any]:
        """JSON-serializable settings that the run's manifest lists."""
        return {}

    def documents(self) -> dict[str, str]:
        """Texts of the sensor's files per run, by file name."""
        return {}

    def write_readings(  # noqa: B027  # most sensors write a file per measurement instead
        self, folder: Path, settings: DriveSettings, times_s: NDArray[np.float64]
    ) -> None:
        """Write the missing files that hold all measurements, made at times (n,).

        Raises:
            OutputError: a file cannot be written.
        """

    def check_trajectory(  # noqa: B027  # most sensors accept any trajectory
        self, truth: Trajectory, times_s: NDArray[np.float64]
    ) -> None:
        """Raise an error if the sensor cannot measure a trajectory at times (n,).

        Raises:
            RunError: the trajectory is unsuitable; names sensor, step and expected value.
        """

    def note(self, times_s: NDArray[np.float64]) -> str | None:
        """Notice on what measurements at times (n,) omit; None if they omit nothing."""
        return None


class RenderedSensor(MountedSensor):
    """Mounted sensor that measures with its own renderer."""

    def open(self, stage: SharedScene, mounting: Mounting) -> Any:
        """Open the renderer on a stage, at the mount on the vehicle; see `Stage.open`."""
        given = mounting.base_from_sensor
        return cast(Stage, stage).open(
            self.sensor,
            self.base_from_sensor if given is None else given,
            hidden={*self.hides, *mounting.hidden},
            vehicle=mounting.vehicle,
            seed=mounting.seed,
            unlit=mounting.unlit,
        )

    def instrument(self, stage: Stage, settings: DriveSettings) -> Instrument:
        """Open the renderer for a drive; the noise seeds of a vehicle's sensors all differ."""
        seed = f"{settings.seed} {self.name}"
        mounting = Mounting(vehicle=settings.vehicle, seed=seed, unlit=settings.unlit)
        renderer = self.open(stage, mounting)
        return Instrument(renderer, partial(self.begin, renderer, settings))

    def begin(self, renderer: Any, settings: DriveSettings, moment: Moment) -> Pending[Measurement]:
        """Begin to measure, see `measure`; by default all of it."""
        measurement = self.measure(renderer, settings, moment)
        return Pending(lambda: measurement)

    @abstractmethod
    def measure(self, renderer: Any, settings: DriveSettings, moment: Moment) -> Measurement:
        """Measure the moving world at a moment.

        Args:
            renderer: renderer that the sensor opened.
            settings: settings of the drive.
            moment: time and index of the measurement.

        Raises:
            RunError: the files of the previous step are damaged.
        """
