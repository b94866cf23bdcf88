"""Interface of export formats."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Floats
from omnisim.core.errors import OutputError
from omnisim.datasets.export.recording import RecordedCamera, Recording
from omnisim.datasets.export.ros2 import CloudLayout
from omnisim.rendering.sensor import SensorSettings

NANOSECONDS = 1_000_000_000
MAX_S = 2**31 - 1  # in 2038: ROS has signed 32-bit seconds

PrintNote = Callable[[str], None]


@dataclass(frozen=True)
class ExportSettings:
    """Settings of an export."""

    start_ns: int = 0  # stamp of the time 0 s, nanoseconds since 1970
    compressed: bool = False  # True: images as PNG files instead of pixels, if the format has both
    # True: also points from each camera's ranges, if the format has point clouds
    with_points: bool = False
    cloud_layout: CloudLayout = "generic"  # layout of lidar clouds, if the format has messages
    with_map: bool = True  # False: no transform of `map`, if the format has transforms

    def stamps_ns(self, times_s: Floats, source: Path) -> list[int]:
        """Stamps of times, whole nanoseconds since 1970; messages name the file `source`.

        Raises:
            OutputError: a stamp before 1970, or later than ROS supports.
        """
        largest_s = MAX_S - self.start_ns / NANOSECONDS
        for time_s in times_s.tolist():
            if not -self.start_ns / NANOSECONDS <= time_s < largest_s:  # also refuses NaN
                raise OutputError(
                    f"{source}: time {time_s:g} s: expected a stamp from 1970 to 2038: "
                    "set another --start-time"
                )
        return [self.start_ns + round(time_s * NANOSECONDS) for time_s in times_s.tolist()]


class ExportFormat(ABC):
    """Export format."""

    name: ClassVar[str]  # name on the command line
    # sensors, lone_sensors: classes of supported sensors besides cameras, and of sensors that are
    # supported only in runs without a camera
    sensors: ClassVar[tuple[type[SensorSettings], ...]] = ()
    lone_sensors: ClassVar[tuple[type[SensorSettings], ...]] = ()
    # True: stores the base's motion, and so supports runs without any sensor
    holds_motion: ClassVar[bool] = False
    channels: ClassVar[tuple[str, ...]] = ()  # supported channels of ground truth
    dates_stamps: ClassVar[bool] = True  # True: stamps count from 1970
    # True: each sensor has its own stamps; False: a frame has one measurement of each sensor
    has_clocks: ClassVar[bool] = False
    has_messages: ClassVar[bool] = False  # True: stores images as pixels or PNG, and point clouds

    def supported_cameras(
        self, cameras: Sequence[RecordedCamera], print_note: PrintNote
    ) -> Sequence[RecordedCamera]:
        """Cameras that the format has room for: all, by default; notes name those left out."""
        return cameras

    @abstractmethod
    def write(
        self, recording: Recording, folder: Path, settings: ExportSettings, print_note: PrintNote
    ) -> Iterator[int]:
        """Write a run into an empty folder; yield the number of finished steps after each.

        Raises:
            OmnisimError: a file of the run is damaged, or the format lacks required content.
        """


class OneCameraFormat(ExportFormat):
    """Base of formats of one camera."""

    def supported_cameras(
        self, cameras: Sequence[RecordedCamera], print_note: PrintNote
    ) -> Sequence[RecordedCamera]:
        """The first camera."""
        if len(cameras) > 1:
            print_note(
                f"{self.name} holds one camera: {cameras[0].name}; --camera-name selects "
                f"another of {', '.join(camera.name for camera in cameras)}"
            )
        return cameras[:1]


# Stamps in the text files of data sets: exact, from integer nanoseconds.


def seconds_text(stamp_ns: int) -> str:
    """Text of a stamp in seconds since 1970, with nine decimals."""
    seconds, nanoseconds = divmod(stamp_ns, NANOSECONDS)
    return f"{seconds}.{nanoseconds:09d}"


def date_text(stamp_ns: int) -> str:
    """Date and time of day in UTC with nine decimals, as in KITTI's timestamps.txt."""
    seconds, nanoseconds = divmod(stamp_ns, NANOSECONDS)
    moment = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(seconds=seconds)
    return f"{moment:%Y-%m-%d %H:%M:%S}.{nanoseconds:09d}"


def restamped(lines: Iterable[str], stamps: Iterable[str], separator: str) -> Iterator[str]:
    """Lines of a trajectory file, header first, with the first column replaced by exact stamps."""
    rows = iter(lines)
    yield next(rows)
    for line, stamp in zip(rows, stamps, strict=True):
        yield stamp + separator + line.partition(separator)[2]


# Depths as 16-bit images.


MAX_DEPTH = np.iinfo(np.uint16).max


class FarDepths:
    """Encoder of a camera's depths as integer steps, 0 for none; counts those past its range."""

    def __init__(self, camera: str, steps_per_m: float):
        self._camera, self._steps_per_m = camera, steps_per_m
        self._count = 0

    def encode(self, depths_m: NDArray[np.floating[Any]]) -> NDArray[np.uint16]:
        """Integer steps (height, width) of depths; +inf and depths out of range become 0."""
        steps = np.round(np.where(np.isfinite(depths_m), depths_m, 0.0) * self._steps_per_m)
        fits = (steps >= 0.0) & (steps <= MAX_DEPTH)
        self._count += int(np.count_nonzero(~fits))
        return np.where(fits, steps, 0.0).astype(np.uint16)

    def note(self, print_note: PrintNote) -> None:
        """Print a note with the number of depths out of range, if there are any."""
        if self._count:
            limit_m = MAX_DEPTH / self._steps_per_m
            print_note(f"{self._camera}: {self._count} depths past {limit_m:.1f} m become 0")
