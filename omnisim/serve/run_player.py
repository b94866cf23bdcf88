"""Recorded run as a stream, in place of a simulation."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Sequence
from pathlib import Path

from omnisim.core.errors import ServeError
from omnisim.datasets.export.export_format import NANOSECONDS, ExportSettings
from omnisim.datasets.export.recording import Recording
from omnisim.datasets.export.ros2 import CloudLayout
from omnisim.datasets.export.ros2 import ros_messages as ros
from omnisim.datasets.export.ros2.bag_format import StampedMessage, open_streams, write_messages
from omnisim.runs.commanded_motion import TICKS_PER_S
from omnisim.runs.run_folder import MANIFEST
from omnisim.serve.publisher import Publisher, Topic
from omnisim.serve.served_robot import is_best_effort
from omnisim.serve.served_world import Served

PLAYED = "a run is played back: expected none of the requests that change it"


def is_run(path: Path) -> bool:
    """True for the folder of a run."""
    return (path / MANIFEST).is_file()


class RunPlayer(Served):
    """Messages of a run, as its bag has them, published when their time comes.

    Args:
        path: folder of a finished run.
        layout: layout of lidar clouds.
    """

    def __init__(self, path: Path, layout: CloudLayout = "generic"):
        self._path, self._settings = path, ExportSettings(cloud_layout=layout)
        self.publishers: list[Publisher] = []
        self.topics: list[Topic] = []
        self.now_s, self.end_s, self._is_reset = 0.0, math.inf, False
        self._written: deque[StampedMessage] = deque()
        self._latched: dict[str, StampedMessage] = {}

    def open(self) -> None:
        """Read the run.

        Raises:
            OmnisimError: not a run, an unfinished run, or a damaged file.
        """
        self._recording = Recording.read(self._path)
        self._streams = open_streams(self._recording, self._settings)
        self.end_s = float(self._recording.truth.times_s[-1]) + 1e-3
        kinds: dict[str, str] = {}
        steps = self._begin()
        for _ in steps:  # until every stream has had its turn
            while self._written:
                message = self._written.popleft()
                kinds[message.topic] = ros.message_type(message.message)
            if all(any(topic.startswith(f"/{each.topic}/") for topic in kinds if topic not in
                       self._latched) for each in self._streams):  # fmt: skip
                break
        self.topics = [
            Topic(name, kind, name in self._latched, is_best_effort(name))
            for name, kind in kinds.items()
        ]
        self._steps = self._begin()

    def announce(self) -> None:
        """Publish what does not change."""
        for message in self._latched.values():
            self._publish(message)

    @property
    def robots(self) -> Sequence[str]:
        """Name of the recorded robot."""
        return (str(self._path),)

    def command(self, robot: str, speed_mps: float, turn_rate_radps: float) -> None:
        """Refuse a command."""
        raise ServeError(PLAYED)

    def set_pose(self, robot: str, x_m: float, y_m: float, yaw_rad: float) -> None:
        """Refuse another place."""
        raise ServeError(PLAYED)

    def reset(self) -> None:
        """Play from the start."""
        self._is_reset = True

    def advance(self) -> None:
        """Publish what was measured until the next tick."""
        if self._is_reset:
            self._is_reset, self._steps, self.now_s = False, self._begin(), 0.0
        self.now_s = (round(self.now_s * TICKS_PER_S) + 1) / TICKS_PER_S
        while True:
            while not self._written:
                if next(self._steps, None) is None:
                    return
            if self._written[0].stamp_ns > self.now_s * NANOSECONDS:
                return
            self._publish(self._written.popleft())

    def write(self, topic: str, stamp_ns: int, message: object, is_latched: bool = False) -> None:
        """Keep a message of the run until its time comes; it is a `MessageWriter`."""
        written = StampedMessage(topic, stamp_ns, message)
        if is_latched:
            self._latched[topic] = written
        self._written.append(written)

    def _begin(self) -> Iterator[int]:
        self._written.clear()
        return write_messages(self._recording, self._streams, self._settings, self)

    def _publish(self, message: StampedMessage) -> None:
        for publisher in self.publishers:
            publisher.publish(message.topic, message.stamp_ns, message.message)
