"""What a protocol of a served robot provides: topics out, and commands in."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol


@dataclass(frozen=True)
class Topic:
    """Stream of ROS 2 messages of one type.

    Attributes:
        name: name with its leading slash, as in bags.
        type: ROS 2 type such as "sensor_msgs/msg/Image".
        is_latched: late subscribers receive the last message, as of `/tf_static`.
        is_best_effort: messages may be lost, as drivers publish their sensors' data.
    """

    name: str
    type: str
    is_latched: bool = False
    is_best_effort: bool = False


@dataclass(frozen=True)
class Client:
    """Connected client, as the page shows it."""

    protocol: str
    name: str  # address, or what the client calls itself
    topics: tuple[str, ...] = ()  # topics that it subscribes to
    dropped: int = 0  # messages dropped because it reads too slowly


class Controls(Protocol):
    """Requests of clients to the simulation, from any thread; no method blocks.

    Raises:
        ServeError: an unknown robot, a value that is not finite, or a request that this simulation
            does not take; one line, which the protocol returns to the client.
    """

    @property
    def robots(self) -> Sequence[str]:
        """Names of the robots; the first is that of commands without a name."""

    @property
    def is_paused(self) -> bool:
        """True while simulated time stands still."""

    @property
    def now_s(self) -> float:
        """Simulated time."""

    @property
    def clients(self) -> Sequence[Client]:
        """Connected clients of all protocols."""

    def command(self, robot: str, speed_mps: float, turn_rate_radps: float) -> None:
        """Drive at a speed (m/s) and turn rate (rad/s) until the next command or the timeout."""

    def pause(self, is_paused: bool) -> None:
        """Stop or resume simulated time."""

    def step(self, seconds: float, then: Callable[[float], None] | None = None) -> None:
        """Advance paused or lockstepped simulated time; `then` receives the time reached.

        All messages of the time up to there are published before.
        """

    def reset(self) -> None:
        """Begin again: time 0, all robots at their starts."""

    def set_pose(self, robot: str, x_m: float, y_m: float, yaw_rad: float) -> None:
        """Put a robot at a place, at rest."""


class Publisher(ABC):
    """One protocol's server. Methods are called from the simulation's threads and never block."""

    protocol: str  # such as "foxglove"

    @abstractmethod
    def open(self, topics: Sequence[Topic], controls: Controls) -> str:
        """Begin to serve; returns the line that tells people where.

        Raises:
            OmnisimError: an extra is missing, or the port is taken; one line.
        """

    @abstractmethod
    def wants(self, topic: str) -> bool:
        """True if anyone receives the topic now; what nobody wants is not measured."""

    @abstractmethod
    def publish(self, topic: str, stamp_ns: int, message: Any) -> None:
        """Publish a message of `omnisim.datasets.export.ros2.ros_messages`, stamped in ns."""

    @property
    def clients(self) -> list[Client]:
        """Connected clients; empty where the protocol cannot tell."""
        return []

    @abstractmethod
    def close(self) -> None:
        """Disconnect all clients, and stop; a second call does nothing."""
