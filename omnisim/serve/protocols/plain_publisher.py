"""Served robots on a plain WebSocket, for programs in any language, and a page on the same port.

A message to a client is 4 bytes with the length of a JSON header, little-endian, the header, and
the bytes of its arrays, one after the other:

    {"op": "message", "topic": "/scan", "type": "sensor_msgs/msg/LaserScan", "stamp_ns": 100000000,
     "message": {…, "ranges": {"array": 0}}, "arrays": [{"dtype": "<f4", "shape": [361]}]}

The message has the fields of the ROS 2 type; arrays of more than 64 numbers are in the bytes.

Requests are JSON texts; those with an "id" are answered, with "done" or "error":

    {"op": "subscribe", "topics": ["/omnicam/image_raw"], "id": 1}      topics ["*"]: all
    {"op": "command", "robot": "", "speed_mps": 0.3, "turn_rate_radps": 0.1}
    {"op": "step", "seconds": 0.1, "id": 2}      the answer follows its messages
    {"op": "pause", "is_paused": true}    {"op": "reset"}
    {"op": "set_pose", "robot": "", "x_m": 0, "y_m": 0, "yaw_rad": 0}
    {"op": "state"}      soon a message "state" comes: the time, and the clients of all protocols
"""

from __future__ import annotations

import asyncio
import dataclasses
import functools
import json
import logging
import math
import threading
import time
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import numpy as np
from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from omnisim.core.errors import OmnisimError, OutputError, ServeError
from omnisim.datasets.export.ros2 import ros_messages as ros
from omnisim.serve.access import Access, PacedConnection
from omnisim.serve.page_files import PAGES, PageFiles
from omnisim.serve.publisher import Client, Controls, Publisher, Topic

PAGE_FILES = PageFiles(PAGES / "robot")
MAX_QUEUE = 1024  # messages that wait for a client: seconds of a robot with an IMU
MAX_QUEUE_BYTES = 64 << 20
MAX_KEPT_BYTES = 1 << 30  # in lockstep, where only a client that reads nothing loses messages
MAX_CLIENTS = 32
MAX_MESSAGE_BYTES = 1 << 16  # of a client
STATE_S = 0.05  # after which many requests for the state have one answer
MAX_LISTED = 64  # longer arrays follow the header as bytes
ALL = "*"
# Requests with the names and types of their values, besides op and id.
_REQUESTS: dict[str, dict[str, type]] = {
    "subscribe": {"topics": list},
    "command": {"robot": str, "speed_mps": float, "turn_rate_radps": float},
    "step": {"seconds": float},
    "pause": {"is_paused": bool},
    "reset": {},
    "state": {},
    "set_pose": {"robot": str, "x_m": float, "y_m": float, "yaw_rad": float},
}


class _Reader:
    """Client with its queue, whose oldest messages are dropped."""

    def __init__(self, connection: ServerConnection, keeps_all: bool):
        self.connection, self._keeps_all = connection, keeps_all
        self.topics: frozenset[str] = frozenset()
        self.dropped = 0
        self.waits_for_state = False
        self._queue: deque[bytes] = deque()
        self._bytes = 0
        self._news = asyncio.Event()

    @property
    def name(self) -> str:
        """Address of the client."""
        return ":".join(map(str, (self.connection.remote_address or ("?",))[:2]))

    def wants(self, topic: str) -> bool:
        """True if it subscribes to a topic."""
        return topic in self.topics or ALL in self.topics

    def put(self, data: bytes) -> None:
        """Queue a message, and drop the oldest ones beyond the limits."""
        self._queue.append(data)
        self._bytes += len(data)
        most = MAX_KEPT_BYTES if self._keeps_all else MAX_QUEUE_BYTES
        while len(self._queue) > 1 and (
            self._bytes > most or (len(self._queue) > MAX_QUEUE and not self._keeps_all)
        ):
            self._bytes -= len(self._queue.popleft())
            self.dropped += 1
        self._news.set()

    async def send_all(self) -> None:
        """Send messages until the connection ends."""
        told = 0
        with suppress(ConnectionClosed):
            while True:
                await self._news.wait()
                self._news.clear()
                while self._queue:
                    data = self._queue.popleft()
                    self._bytes -= len(data)
                    await self.connection.send(data)
                if self.dropped > told:
                    told = self.dropped
                    await self.connection.send(pack({"op": "dropped", "dropped": told}))


class PlainPublisher(Publisher):
    """WebSocket server of its own thread, with a page for browsers.

    Args:
        host: address to listen on; others than localhost need the token of the printed address.
        port: port to listen on; 0: any free port.
        keeps_all: keep all messages of clients that read them, for lockstep.
    """

    protocol = "plain"

    def __init__(self, host: str = "localhost", port: int = 8766, keeps_all: bool = False):
        self._host, self._port, self._keeps_all = host, port, keeps_all
        self._access = Access.to(host)
        self._readers: list[_Reader] = []
        self._latched: dict[str, bytes] = {}
        self._topics: dict[str, Topic] = {}
        self._thread: threading.Thread | None = None

    def open(self, topics: Sequence[Topic], controls: Controls) -> str:
        """Begin to serve; returns the address.

        Raises:
            OutputError: the port is taken, or the address does not belong to this machine.
        """
        self._topics, self._controls = {topic.name: topic for topic in topics}, controls
        self._loop, self._end = asyncio.new_event_loop(), asyncio.Event()
        started, errors = threading.Event(), list[BaseException]()
        self._thread = threading.Thread(
            target=self._run, args=(started, errors), name="omnisim-plain", daemon=True
        )
        self._thread.start()
        started.wait()
        if errors:
            cause = getattr(errors[0], "strerror", None) or str(errors[0])
            where = f"--port {self._port}: cannot listen on {self._host}: {cause}"
            raise OutputError(where) from None
        return f"Page and plain protocol: {self.url}"

    @property
    def url(self) -> str:
        """Address of the page, including the token; it is that of the WebSocket, too."""
        host = "localhost" if self._host in ("", "0.0.0.0", "::") else self._host
        host = f"[{host}]" if ":" in host else host
        return f"http://{host}:{self._port}{self._access.query or '/'}"

    def wants(self, topic: str) -> bool:
        """True if a client subscribes to the topic; latched ones are kept for later."""
        known = self._topics.get(topic)
        is_latched = known is not None and known.is_latched
        return is_latched or any(reader.wants(topic) for reader in tuple(self._readers))

    def publish(self, topic: str, stamp_ns: int, message: Any) -> None:
        """Publish a message."""
        if not self.wants(topic):
            return
        data = pack_message(topic, stamp_ns, message)
        with suppress(RuntimeError):  # the loop has ended
            self._loop.call_soon_threadsafe(self._spread, topic, data)

    @property
    def clients(self) -> list[Client]:
        """Connected clients."""
        return [
            Client(self.protocol, reader.name, tuple(sorted(reader.topics)), reader.dropped)
            for reader in tuple(self._readers)
        ]

    def close(self) -> None:
        """Disconnect all clients, and stop; a second call does nothing."""
        if self._thread is not None:
            with suppress(RuntimeError):
                self._loop.call_soon_threadsafe(self._end.set)
            self._thread.join()
            self._thread = None

    def _run(self, started: threading.Event, errors: list[BaseException]) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(self._serve(started))
        except (OSError, OverflowError, ValueError) as reason:
            errors.append(reason)
        finally:
            self._loop.close()
            started.set()

    async def _serve(self, started: threading.Event) -> None:
        async with serve(
            self._talk, self._host, self._port, process_request=self._check,
            create_connection=PacedConnection, max_size=MAX_MESSAGE_BYTES, max_queue=4,
            compression=None, close_timeout=0.2, server_header=None,
            logger=logging.Logger("", logging.CRITICAL),
        ) as server:  # fmt: skip
            self._port = int(next(iter(server.sockets)).getsockname()[1])
            started.set()
            await self._end.wait()

    def _check(self, connection: ServerConnection, request: Request) -> Response | None:
        if "Upgrade" not in request.headers:  # no WebSocket
            answer = self._access.check_host(connection, request) or PAGE_FILES.answer(request)
            return answer or self._access.refuse(connection, 404, "no such file")
        if len(self._readers) >= MAX_CLIENTS:
            return self._access.refuse(connection, 503, "too many clients")
        return self._access.check(connection, request)

    def _spread(self, topic: str, data: bytes) -> None:
        if self._topics[topic].is_latched:
            self._latched[topic] = data
        for reader in self._readers:
            if reader.wants(topic):
                reader.put(data)

    async def _talk(self, connection: ServerConnection) -> None:
        if len(self._readers) >= MAX_CLIENTS:  # several came at once
            return await connection.close(1013, f"expected at most {MAX_CLIENTS} clients")
        reader = _Reader(connection, self._keeps_all)
        topics = [dataclasses.asdict(topic) for topic in self._topics.values()]
        robots = list(self._controls.robots)
        reader.put(pack({"op": "hello", "robots": robots, "topics": topics, "client": reader.name}))
        self._readers.append(reader)
        sending = asyncio.ensure_future(reader.send_all())
        try:
            async for text in connection:
                self._take(reader, text)
        except ConnectionClosed:
            pass
        finally:
            self._readers.remove(reader)
            sending.cancel()

    def _take(self, reader: _Reader, text: str | bytes) -> None:
        """Do what a client asks, or answer with the reason why not."""
        number: Any = None
        try:
            request = _parse(text)
            op, number = request.pop("op"), request.pop("id", None)
            if op == "subscribe":
                self._subscribe(reader, request["topics"])
            elif op == "step":
                self._controls.step(request["seconds"], self._answer(reader, number))
                return
            elif op == "state":
                if not reader.waits_for_state:
                    reader.waits_for_state = True
                    self._loop.call_later(STATE_S, self._tell_state, reader)
                return
            else:
                getattr(self._controls, op)(**request)
        except OmnisimError as reason:
            reader.put(pack({"op": "error", "id": number, "text": str(reason)}))
            return
        if number is not None:
            reader.put(pack({"op": "done", "id": number}))

    def _answer(self, reader: _Reader, number: Any) -> Any:
        def done(now_s: float) -> None:
            data = pack({"op": "done", "id": number, "now_s": now_s})
            with suppress(RuntimeError):
                self._loop.call_soon_threadsafe(reader.put, data)

        return done

    def _tell_state(self, reader: _Reader) -> None:
        controls, reader.waits_for_state = self._controls, False
        clients = [dataclasses.asdict(client) for client in controls.clients]
        times_s = {"now_s": controls.now_s, "wall_s": time.monotonic()}
        paused = {"is_paused": controls.is_paused}
        reader.put(pack({"op": "state", **times_s, **paused, "clients": clients}))

    def _subscribe(self, reader: _Reader, names: list[Any]) -> None:
        for name in names:
            if not isinstance(name, str) or (name != ALL and name not in self._topics):
                raise ServeError(f"topics: {str(name)[:100]!r}: no such topic")
        new = frozenset(names) - reader.topics
        reader.topics = frozenset(names)
        for topic, data in self._latched.items():
            if topic in new or ALL in new:
                reader.put(data)


def _parse(text: str | bytes) -> dict[str, Any]:
    """Request of a client.

    Raises:
        ServeError: not a request, or a value of another type.
    """
    try:
        request = json.loads(text)
    except (ValueError, RecursionError):
        raise ServeError("expected a request as JSON") from None
    op = request.get("op") if isinstance(request, dict) else None
    if not isinstance(op, str) or op not in _REQUESTS:
        raise ServeError(f"op: expected one of {', '.join(_REQUESTS)}")
    kinds = _REQUESTS[op]
    values = {"robot": "", **request} if "robot" in kinds else request
    number = values.pop("id", None)
    if set(values) != {"op", *kinds}:
        raise ServeError(f"{op}: expected the values {', '.join(kinds) or 'none'}")
    for name, kind in kinds.items():
        value = values[name]
        fits = isinstance(value, kind) or (
            kind is float and isinstance(value, int) and not isinstance(value, bool)
        )
        if not fits:
            raise ServeError(f"{op}: {name}: expected a {kind.__name__}")
    if number is not None and not isinstance(number, int):
        raise ServeError(f"{op}: id: expected an integer")
    return {**values, "id": number}


def pack_message(topic: str, stamp_ns: int, message: object) -> bytes:
    """Bytes of a ROS 2 message of `omnisim.datasets.export.ros2.ros_messages`."""
    arrays: list[np.ndarray[Any, Any]] = []
    content = _plain(message, arrays)
    about = [{"dtype": array.dtype.str, "shape": list(array.shape)} for array in arrays]
    kind = ros.message_type(message)
    header = {"op": "message", "topic": topic, "type": kind, "stamp_ns": stamp_ns}
    parts = [np.ascontiguousarray(array).tobytes() for array in arrays]
    return pack({**header, "message": content, "arrays": about}, parts)


def pack(header: dict[str, Any], parts: list[bytes] | tuple[bytes, ...] = ()) -> bytes:
    """Bytes of a header and what follows it."""
    text = json.dumps(header, allow_nan=False).encode()
    return b"".join((len(text).to_bytes(4, "little"), text, *parts))


@functools.cache
def _names(kind: type) -> tuple[str, ...]:
    """Names of a message's fields; none of another value."""
    fields = dataclasses.fields(kind) if dataclasses.is_dataclass(kind) else ()
    return tuple(field.name for field in fields if not field.name.startswith("__"))


def _plain(value: Any, arrays: list[np.ndarray[Any, Any]]) -> Any:
    """Value in JSON types; long arrays are moved to `arrays`."""
    kind: type = type(value)
    if names := _names(kind):
        return {name: _plain(getattr(value, name), arrays) for name in names}
    if isinstance(value, np.ndarray):
        if value.size > MAX_LISTED or not np.all(np.isfinite(value)):
            arrays.append(value)
            return {"array": len(arrays) - 1}
        return value.tolist()
    if isinstance(value, list | tuple):
        return [_plain(item, arrays) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)  # JSON has no infinity
    return value.item() if isinstance(value, np.generic) else value
