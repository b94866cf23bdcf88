"""Client of a served robot, in one file: only websockets and NumPy are needed.

    from omnisim.serve import connect

    with connect("ws://localhost:8766", topics=["/omnicam/image_raw"]) as robot:
        for message in robot:
            print(message.topic, message.stamp_s, message.image.shape)
            robot.command(0.3, 0.1)

A lockstepped simulation waits for `step`, and its messages are there when it returns.
"""

from __future__ import annotations

import json
import threading
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from websockets.exceptions import ConnectionClosed, InvalidHandshake, InvalidURI
from websockets.sync.client import ClientConnection
from websockets.sync.client import connect as open_connection

DTYPES = {"rgb8": ("u1", 3), "16UC1": ("<u2", 1), "32SC1": ("<i4", 1), "32FC1": ("<f4", 1)}
POINT_TYPES = {1: "i1", 2: "u1", 3: "<i2", 4: "<u2", 5: "<i4", 6: "<u4", 7: "<f4", 8: "<f8"}
KEPT = 10_000  # messages that wait here to be read; older ones are dropped


class ServeConnectionError(ConnectionError):
    """The server is not there, refused the client, or answered a request with an error."""


@dataclass(frozen=True, eq=False)
class ServedMessage:
    """Message of a topic: the fields of a ROS 2 type, with arrays as NumPy arrays."""

    topic: str
    type: str
    stamp_ns: int
    fields: dict[str, Any]

    @property
    def stamp_s(self) -> float:
        """Simulated time of the measurement."""
        return 1e-9 * self.stamp_ns

    @property
    def image(self) -> NDArray[Any]:
        """Pixels (height, width, 3) of an image, or (height, width) of ranges and labels."""
        dtype, channels = DTYPES[self.fields["encoding"]]
        shape = self.fields["height"], self.fields["width"], channels
        pixels = self.fields["data"].view(dtype).reshape(shape)
        return pixels if channels > 1 else pixels[..., 0]

    @property
    def points(self) -> NDArray[np.void]:
        """Points (n,) of a cloud, with its fields by name."""
        fields = self.fields["fields"]
        dtype = np.dtype(
            {
                "names": [field["name"] for field in fields],
                "formats": [POINT_TYPES[field["datatype"]] for field in fields],
                "offsets": [field["offset"] for field in fields],
                "itemsize": self.fields["point_step"],
            }
        )
        return self.fields["data"].view(dtype)


class ServedRobotClient:
    """Connection to a served robot; `connect` opens it. Use it as a context manager.

    Attributes:
        about: what the server says of itself: robots, topics and the clock.
    """

    def __init__(self, connection: ClientConnection, timeout_s: float):
        self._connection, self._timeout_s = connection, timeout_s
        self._messages: deque[ServedMessage] = deque(maxlen=KEPT)
        self._news = threading.Condition()
        self._answers: dict[int, dict[str, Any]] = {}
        self._requests = 0
        self._error: str | None = None
        self._is_open = True
        self._dropped_there = self._dropped_here = 0
        header, _ = _unpack(connection.recv(timeout=timeout_s))
        self.about: dict[str, Any] = header
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def __enter__(self) -> Self:
        """Itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Close the connection."""
        self.close()

    def __iter__(self) -> Iterator[ServedMessage]:
        """Messages, until the connection ends."""
        while (message := self.next(None)) is not None:
            yield message

    @property
    def dropped(self) -> int:
        """Number of messages dropped, here or by the server, as they were read too slowly."""
        return self._dropped_there + self._dropped_here

    def subscribe(self, topics: Sequence[str]) -> None:
        """Receive these topics, or all for ["*"]; instead of those before."""
        self._ask({"op": "subscribe", "topics": list(topics)})

    def next(self, timeout_s: float | None = 0.0) -> ServedMessage | None:
        """Oldest message that is not read yet; None: none within a time, or the end."""
        with self._news:
            self._news.wait_for(lambda: self._messages or not self._is_open, timeout_s)
            return self._messages.popleft() if self._messages else None

    def command(self, speed_mps: float, turn_rate_radps: float, robot: str = "") -> None:
        """Drive at a speed and turn rate until the next command or the server's timeout."""
        rates = {"speed_mps": float(speed_mps), "turn_rate_radps": float(turn_rate_radps)}
        self._send({"op": "command", "robot": robot, **rates})

    def step(self, seconds: float) -> float:
        """Advance a lockstepped or paused simulation; its messages are there afterwards.

        Returns:
            Simulated time.
        """
        return float(self._ask({"op": "step", "seconds": float(seconds)})["now_s"])

    def reset(self) -> None:
        """Begin again at time 0, with all robots at their starts."""
        self._ask({"op": "reset"})

    def pause(self, is_paused: bool = True) -> None:
        """Stop or resume simulated time."""
        self._ask({"op": "pause", "is_paused": is_paused})

    def set_pose(self, x_m: float, y_m: float, yaw_rad: float, robot: str = "") -> None:
        """Put a robot at a place, at rest."""
        place = {"x_m": float(x_m), "y_m": float(y_m), "yaw_rad": float(yaw_rad)}
        self._ask({"op": "set_pose", "robot": robot, **place})

    def close(self) -> None:
        """Close the connection; a second call does nothing."""
        self._connection.close()
        self._reader.join()

    def _send(self, request: dict[str, Any]) -> None:
        if self._error is not None:
            text, self._error = self._error, None
            raise ServeConnectionError(text)
        try:
            self._connection.send(json.dumps(request))
        except ConnectionClosed:
            raise ServeConnectionError("the server closed the connection") from None

    def _ask(self, request: dict[str, Any]) -> dict[str, Any]:
        """Send a request, and wait for its answer."""
        self._requests += 1
        number = self._requests
        self._send({**request, "id": number})
        with self._news:
            is_there = self._news.wait_for(
                lambda: number in self._answers or not self._is_open, self._timeout_s
            )
            if number not in self._answers:
                text = "the server closed the connection" if is_there else "the server is silent"
                raise ServeConnectionError(text)
            answer = self._answers.pop(number)
        if answer["op"] == "error":
            raise ServeConnectionError(answer["text"])
        return answer

    def _read(self) -> None:
        try:
            for data in self._connection:
                header, rest = _unpack(data)
                with self._news:
                    self._take(header, rest)
                    self._news.notify_all()
        except (ConnectionClosed, ValueError):
            pass
        with self._news:
            self._is_open = False
            self._news.notify_all()

    def _take(self, header: dict[str, Any], rest: memoryview) -> None:
        self._dropped_there = header.get("dropped", self._dropped_there)
        if header["op"] == "message":
            fields = _with_arrays(header["message"], _arrays(header["arrays"], rest))
            about = header["topic"], header["type"], header["stamp_ns"]
            self._dropped_here += len(self._messages) == KEPT
            self._messages.append(ServedMessage(*about, fields))
        elif header.get("id") is not None:
            self._answers[header["id"]] = header
        elif header["op"] == "error":  # of a command, which nobody waits for
            self._error = header["text"]


def connect(
    address: str = "ws://localhost:8766", topics: Sequence[str] = (), timeout_s: float = 60.0
) -> ServedRobotClient:
    """Connect to a served robot.

    Args:
        address: address that `omnisim serve` prints, with its token if it has one; that of the
            page in a browser will do.
        topics: topics to receive; ["*"]: all.
        timeout_s: time to wait for an answer.

    Raises:
        ServeConnectionError: no server there, or it refuses the client.
    """
    try:
        url = f"ws{address.removeprefix('http')}" if address.startswith("http") else address
        opened = open_connection(url, max_size=None, open_timeout=timeout_s, proxy=None)
        client = ServedRobotClient(opened.__enter__(), timeout_s)
    except (OSError, InvalidHandshake, InvalidURI, ConnectionClosed) as reason:
        raise ServeConnectionError(f"{address}: {reason}") from None
    if topics:
        client.subscribe(topics)
    return client


def _unpack(data: str | bytes) -> tuple[dict[str, Any], memoryview]:
    """Header, and the bytes behind it."""
    raw = memoryview(data.encode() if isinstance(data, str) else data)
    size = int.from_bytes(raw[:4], "little")
    header: dict[str, Any] = json.loads(bytes(raw[4 : 4 + size]))
    return header, raw[4 + size :]


def _arrays(about: list[dict[str, Any]], rest: memoryview) -> list[NDArray[Any]]:
    found, begin = [], 0
    for each in about:
        count = int(np.prod(each["shape"]))
        array = np.frombuffer(rest, each["dtype"], count, begin).reshape(each["shape"])
        begin += array.nbytes
        found.append(array)
    return found


def _with_arrays(value: Any, arrays: list[NDArray[Any]]) -> Any:
    if isinstance(value, dict):
        if value.keys() == {"array"}:
            return arrays[value["array"]]
        return {key: _with_arrays(item, arrays) for key, item in value.items()}
    return [_with_arrays(item, arrays) for item in value] if isinstance(value, list) else value
