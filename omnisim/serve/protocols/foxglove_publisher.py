"""Served robots in Foxglove and Lichtblick, by the official SDK.

The SDK's server checks neither origin nor token, and limits neither size nor number of a client's
messages. It therefore listens on an address of this machine that no website can guess, and clients
connect to a relay, which checks them, makes floods wait, and counts what is dropped: the SDK keeps
the newest `MAX_QUEUE` messages for a client that reads too slowly. Programs on this machine are
trusted: they can find the SDK's server.

Clients may publish Twist or TwistStamped as JSON on `/cmd_vel`, set the parameter `paused`, and
call the services `/reset`, `/pause`, `/step` and `/set_pose`. `/clock` is the server's time.
"""

from __future__ import annotations

import asyncio
import json
import logging
import secrets
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from contextlib import suppress
from functools import partial
from typing import Any

from pydantic import JsonValue, create_model
from websockets.asyncio.client import connect
from websockets.asyncio.server import ServerConnection, serve
from websockets.typing import Subprotocol

from omnisim.core.errors import OmnisimError, ServeError
from omnisim.core.extras import require_extra
from omnisim.core.files.parameters import Flag, Number, Positive, Table, parse_table
from omnisim.serve.access import Access, PacedConnection
from omnisim.serve.protocols.foxglove_messages import Channels
from omnisim.serve.publisher import Client, Controls, Publisher, Topic

require_extra("serve", "omnisim serve for Foxglove", ServeError)
import foxglove  # noqa: E402  # after what is missing
from foxglove import websocket  # noqa: E402

ORIGINS = ("https://app.foxglove.dev",)
SUBPROTOCOLS = (  # the same, under its former name
    Subprotocol("foxglove.sdk.v1"),
    Subprotocol("foxglove.websocket.v1"),
)
MAX_QUEUE = 128  # messages that wait for a client: 0.4 s of a robot with an IMU
MAX_CLIENTS = 32
MAX_MESSAGE_BYTES = 1 << 16  # of a client, as are
MAX_MESSAGES_PER_S = 200.0
TICK_S = 0.5


class _Vector(Table):
    x: Number = 0.0
    y: Number = 0.0
    z: Number = 0.0


class _Twist(Table):
    linear: _Vector
    angular: _Vector


class _TwistStamped(Table):
    header: JsonValue = None
    twist: _Twist


# Services: arguments of the method of `Controls` of the same name.
_REQUESTS: dict[str, type[Table]] = {
    "reset": create_model("reset", __base__=Table),
    "pause": create_model("pause", __base__=Table, is_paused=(Flag, True)),
    "step": create_model("step", __base__=Table, seconds=(Positive, 0.1)),
    "set_pose": create_model(
        "set_pose", __base__=Table, x_m=(Number, ...), y_m=(Number, ...), yaw_rad=(Number, 0.0)
    ),
}
_ANSWER = {"success": {"type": "boolean"}, "message": {"type": "string"}}


class FoxglovePublisher(Publisher):
    """WebSocket server for Foxglove and Lichtblick.

    Args:
        host: address to listen on; unless it is local, clients need the token of the address.
        port: port to listen on; 0: any free port.
        origins: websites that may connect without a token.
    """

    protocol = "foxglove"

    def __init__(
        self, host: str = "localhost", port: int = 8765, origins: tuple[str, ...] = ORIGINS
    ):
        self._access, self._host, self._port = Access.to(host, origins), host, port
        self._relays: list[_Relay] = []
        self._server: websocket.WebSocketServer | None = None

    def open(self, topics: Sequence[Topic], controls: Controls) -> str:
        """Begin to serve; returns the address.

        Raises:
            ServeError: the port is taken, or the address does not belong to this machine.
        """
        self._channels = Channels(topics)
        self._controls, self._reported_s = controls, 0.0
        random = ".".join(str(1 + secrets.randbelow(254)) for _ in range(3))
        # elsewhere, only the port is random
        inner = f"127.{random}" if sys.platform == "linux" else "127.0.0.1"
        ability = websocket.Capability
        listener = _Listener(self, controls)
        server = self._server = foxglove.start_server(
            name="omnisim", host=inner, port=0, context=self._channels.context,
            message_backlog_size=MAX_QUEUE, server_listener=listener, supported_encodings=["json"],
            services=listener.services(), capabilities=[
                ability.ClientPublish, ability.Parameters, ability.Services, ability.Time,
            ],
        )  # fmt: skip
        self._inner_url, self._opened = f"ws://{inner}:{server.port}", Future[int]()
        serving = self._serve(server)
        self._thread = threading.Thread(target=asyncio.run, args=(serving,), daemon=True)
        self._thread.start()
        try:
            self._port = self._opened.result()
        except ServeError:
            self.close()
            raise
        return f"Foxglove and Lichtblick: {self.url}"

    @property
    def url(self) -> str:
        """Address for clients, including the token."""
        host = "localhost" if self._host in ("", "0.0.0.0", "::") else self._host
        return f"ws://{f'[{host}]' if ':' in host else host}:{self._port}{self._access.query}"

    def wants(self, topic: str) -> bool:
        """True if a client receives the topic now, or it is latched."""
        if self._server is None:
            return False
        return bool(self._relays) if self._channels.is_clock(topic) else self._channels.wants(topic)

    def publish(self, topic: str, stamp_ns: int, message: Any) -> None:
        """Publish a message, stamped in ns."""
        if (server := self._server) is None:
            return
        if self._channels.is_clock(topic):
            server.broadcast_time(stamp_ns)
            return
        for relay in tuple(self._relays):
            relay.sent += topic in tuple(relay.topics.values())
        self._channels.log(topic, stamp_ns, message)

    @property
    def clients(self) -> list[Client]:
        """Connected clients, by address."""
        return [
            Client(self.protocol, relay.name, tuple(relay.topics.values()), relay.dropped)
            for relay in tuple(self._relays)
        ]

    def close(self) -> None:
        """Disconnect all clients, and stop; a second call does nothing."""
        server, self._server = self._server, None
        if server is not None:
            with suppress(RuntimeError):  # the loop has ended
                self._loop.call_soon_threadsafe(self._end.set)
            self._thread.join()
            server.stop()

    async def _serve(self, sdk: websocket.WebSocketServer) -> None:
        """Relay clients to the SDK's server until the end."""
        self._loop, self._end = asyncio.get_running_loop(), asyncio.Event()
        try:
            server = await serve(
                self._relay, self._host, self._port, process_request=self._access.check,
                create_connection=PacedConnection, subprotocols=SUBPROTOCOLS, compression=None,
                max_size=MAX_MESSAGE_BYTES, ping_interval=20.0, ping_timeout=60.0,
                close_timeout=1.0, logger=logging.Logger("", logging.CRITICAL),
            )  # fmt: skip
        except (OSError, OverflowError, ValueError) as reason:
            cause = getattr(reason, "strerror", None) or str(reason)
            text = f"--port {self._port}: cannot listen on {self._host}: {cause}"
            self._opened.set_exception(ServeError(text))
            return
        async with server:
            self._opened.set_result(int(next(iter(server.sockets)).getsockname()[1]))
            was_paused = None
            while not self._end.is_set():
                if (is_paused := self._controls.is_paused) != was_paused:
                    was_paused = is_paused
                    sdk.publish_parameter_values([_paused(is_paused)])
                with suppress(TimeoutError):
                    await asyncio.wait_for(self._end.wait(), TICK_S)

    async def _relay(self, connection: ServerConnection) -> None:
        if len(self._relays) >= MAX_CLIENTS:
            return await connection.close(1013, f"expected at most {MAX_CLIENTS} clients")
        relay = _Relay(connection, self._channels.topics)
        self._relays.append(relay)
        try:
            await relay.run(self._inner_url)
        finally:
            self._relays.remove(relay)

    def repeat(self, topic: str) -> None:
        """Send the last message of a latched topic again, from any thread."""
        with suppress(RuntimeError):  # the loop has ended
            self._loop.call_soon_threadsafe(self._channels.repeat, topic)

    def report(self, text: str) -> None:
        """Show an error to all clients, at most one per second."""
        if self._server is not None and time.monotonic() > self._reported_s + 1.0:
            self._reported_s = time.monotonic()
            text = text.replace("\n", "; ")
            self._server.publish_status(text, foxglove.StatusLevel.Error, "omnisim")


class _Relay:
    """Relay of a client's messages to the SDK's server, and back."""

    def __init__(self, connection: ServerConnection, topics: Mapping[int, str]):
        host, port = connection.remote_address[:2]
        self.name, self.topics = f"{host}:{port}", dict[Any, str]()  # by number of subscription
        self.sent = self._received = 0
        self._connection, self._names = connection, topics

    @property
    def dropped(self) -> int:
        """Number of messages dropped, without the last `MAX_QUEUE`, which may be in the queue."""
        return max(0, self.sent - self._received - MAX_QUEUE)

    async def run(self, url: str) -> None:
        """Relay messages until one of the sides disconnects."""
        async with connect(
            url, subprotocols=SUBPROTOCOLS[:1], compression=None, max_size=None, max_queue=2,
            ping_interval=None, close_timeout=1.0,
        ) as server:  # fmt: skip
            tasks = [asyncio.create_task(way(server)) for way in (self._send, self._receive)]
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            server.transport.abort()  # what is queued has no reader

    async def _send(self, server: Any) -> None:
        """Send the client's messages to the server, `MAX_MESSAGES_PER_S` in the mean."""
        free, last_s = MAX_MESSAGES_PER_S, time.monotonic()
        async for message in self._connection:
            self._follow(message)
            await server.send(message)
            free += (time.monotonic() - last_s) * MAX_MESSAGES_PER_S
            free, last_s = min(MAX_MESSAGES_PER_S, free) - 1.0, time.monotonic()
            await asyncio.sleep(max(0.0, -free / MAX_MESSAGES_PER_S))

    async def _receive(self, server: Any) -> None:
        async for message in server:
            await self._connection.send(message)
            self._received += isinstance(message, bytes) and message[0] == 1  # a topic's message

    def _follow(self, message: str | bytes) -> None:
        """Note subscriptions; errors are reported by the server."""
        with suppress(ValueError, TypeError, LookupError, AttributeError, RecursionError):
            request = json.loads(message) if isinstance(message, str) else {}
            for number in request.get("subscriptionIds", ()):  # the end of subscriptions
                self.topics.pop(number, None)
            for subscription in request.get("subscriptions", ())[: len(self._names)]:
                self.topics[subscription["id"]] = self._names[subscription["channelId"]]


class _Listener(websocket.ServerListener):
    """Passes clients' requests to the simulation; called from the SDK's threads."""

    def __init__(self, publisher: FoxglovePublisher, controls: Controls):
        self._publisher, self._controls = publisher, controls
        self._robots = {"": controls.robots[0]}  # by prefix of topics and services
        if len(controls.robots) > 1:
            self._robots |= {f"/{robot}": robot for robot in controls.robots}
        self._commands: dict[tuple[int, int], tuple[str, type[Table]]] = {}

    def services(self) -> list[foxglove.Service]:
        """Services of the world, and of each robot."""
        calls: dict[str, Callable[..., None]] = {
            f"/{name}": getattr(self._controls, name) for name in ("reset", "pause", "step")
        }
        for prefix, robot in self._robots.items():
            calls[f"{prefix}/set_pose"] = partial(self._controls.set_pose, robot)
        answer = _schema("answer", _ANSWER)
        services = []
        for name, call in calls.items():
            table = _REQUESTS[name.rpartition("/")[2]]
            properties = table.model_json_schema().get("properties", {})
            request = _schema(f"{table.__name__}_request", properties)
            schema = foxglove.ServiceSchema(name=name[1:], request=request, response=answer)
            handler = partial(_answer, call, table)
            services.append(foxglove.Service(name=name, schema=schema, handler=handler))
        return services

    def on_subscribe(self, client: Any, channel: Any) -> None:
        """Send a latched message again."""
        self._publisher.repeat(channel.topic)

    def on_client_advertise(self, client: Any, channel: Any) -> None:
        """Note which robot a client will command."""
        prefix, _, name = channel.topic.rpartition("/")
        if name == "cmd_vel" and prefix in self._robots:
            table = _TwistStamped if channel.schema_name.endswith("Stamped") else _Twist
            self._commands[client.id, channel.id] = self._robots[prefix], table
        else:
            expected = ", ".join(f"{prefix}/cmd_vel" for prefix in self._robots)
            self._publisher.report(f"{channel.topic}: no such topic to publish: {expected}")

    def on_client_unadvertise(self, client: Any, client_channel_id: int) -> None:
        """Forget a channel."""
        self._commands.pop((client.id, client_channel_id), None)

    def on_message_data(self, client: Any, client_channel_id: int, data: bytes) -> None:
        """Command a robot."""
        robot, table = self._commands.get((client.id, client_channel_id), ("", None))
        if table is not None:
            try:
                command = _parsed(data, table, "cmd_vel")
                twist = command.twist if table is _TwistStamped else command
                self._controls.command(robot, twist.linear.x, twist.angular.z)
            except OmnisimError as error:
                self._publisher.report(str(error))

    def on_get_parameters(self, client: Any, param_names: Any, request_id: Any = None) -> Any:
        """Tell whether time is paused."""
        return [_paused(self._controls.is_paused)]

    def on_set_parameters(self, client: Any, parameters: Any, request_id: Any = None) -> Any:
        """Pause or resume."""
        for parameter in parameters:
            value = parameter.get_value()
            if parameter.name == "paused" and isinstance(value, bool):
                self._controls.pause(value)
                return [_paused(value)]
            self._publisher.report(f"parameter {parameter.name}: expected paused, true or false")
        return [_paused(self._controls.is_paused)]


def _answer(
    call: Callable[..., None], table: type[Table], request: foxglove.ServiceRequest
) -> bytes:
    """Response to the call of a service, as that of std_srvs/SetBool."""
    error = ""
    try:
        call(*_parsed(request.payload or b"{}", table, request.service_name).model_dump().values())
    except OmnisimError as reason:
        error = str(reason).replace("\n", "; ")
    return json.dumps({"success": not error, "message": error}).encode()


def _paused(is_paused: bool) -> foxglove.Parameter:
    return foxglove.Parameter("paused", value=is_paused)


def _schema(name: str, properties: dict[str, Any]) -> foxglove.MessageSchema:
    data = json.dumps({"type": "object", "properties": properties}).encode()
    definition = foxglove.Schema(name=name, encoding="jsonschema", data=data)
    return foxglove.MessageSchema(encoding="json", schema=definition)


def _parsed(data: bytes, table: type[Table], source: str) -> Any:
    """Checked content of a JSON object."""
    try:
        content = json.loads(data)
    except (ValueError, RecursionError):
        content = None
    if not isinstance(content, dict):
        raise ServeError(f"{source}: expected a JSON object")
    return parse_table(content, table, ServeError, source)
