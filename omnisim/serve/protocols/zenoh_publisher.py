"""ROS 2 topics and services over Zenoh, for nodes whose middleware is `rmw_zenoh_cpp`.

No ROS is needed here. Like any node of this middleware, the publisher declares a liveliness token
for itself and for each of its topics and services, and puts messages as CDR, with an attachment, on
the key `<domain>/<topic>/<type>/<type hash>`.

Source: github.com/ros2/rmw_zenoh, docs/design.md and rmw_zenoh_cpp/src/detail; REP 2011, hashes of
types; github.com/ros2/common_interfaces, std_srvs.
"""

from __future__ import annotations

import itertools
import json
import math
import os
import re
import struct
import time
from collections import defaultdict, deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from threading import Event, Thread
from typing import Any, Literal

from omnisim.core.errors import ServeError
from omnisim.core.extras import require_extra
from omnisim.serve.publisher import Client, Controls, Publisher, Topic

require_extra("zenoh", "omnisim serve for ROS 2", ServeError)
import xxhash  # noqa: E402  # after what is missing
import zenoh  # noqa: E402
import zenoh.ext  # noqa: E402
from rosbags.interfaces import Nodetype  # noqa: E402
from rosbags.serde import SerdeError  # noqa: E402
from rosbags.typesys import Stores, get_typestore  # noqa: E402

from omnisim.datasets.export.ros2.ros_messages import (  # noqa: E402
    LIVOX,
    LIVOX_CLOUD,
    STORE,
    serialized,
)

ROUTER = "tcp/127.0.0.1:7447"  # where nodes expect their router
NODE = "omnisim"
STEP_S = 0.1  # simulated time per call of /step

# Types that have their own thread and a lower priority, as they wait for slow clients.
LARGE = ("/Image", "/CompressedImage", "/PointCloud2", "/CustomMsg", "/OccupancyGrid")
MAX_QUEUED, MAX_QUEUED_LARGE = 200, 2  # messages per topic; 200 are a second of an IMU

# Limits of what clients send; of commands, only the newest is read.
MAX_COMMAND_BYTES = 4096
MAX_REQUESTS = 16  # waiting per service
MAX_TOKENS = 2000
POLL_S = 0.005

_CONFIG = {
    "scouting/multicast/enabled": False,
    "timestamping/enabled": True,  # latched topics need it
    "transport/link/rx/max_message_size": 2**26,  # that a router passes on
    # Batches of 64 kB that wait for a slow client; µs that a message waits for these, before it is
    # dropped, or if it is a reply, before the client is.
    "transport/link/tx/queue/size/data": 16,
    "transport/link/tx/queue/size/data_low": 16,
    "transport/link/tx/queue/congestion_control/drop/max_wait_before_drop_fragments": 10_000,
    "transport/link/tx/queue/congestion_control/block/wait_before_close": 1_000_000,
}
_ATTACHMENT = struct.Struct("<qqB16s")  # sequence number, ns since 1970, length of the GID, GID

_EMPTY = [("structure_needs_at_least_one_member", (Nodetype.BASE, ("uint8", 0)))]
_BOOL, _TEXT = (Nodetype.BASE, ("bool", 0)), (Nodetype.BASE, ("string", 0))
_ANSWER = [("success", _BOOL), ("message", _TEXT)]
# std_srvs, which rosbags does not have: fields of request and response, and hash.
_SERVICES: dict[str, tuple[list[Any], list[Any], str]] = {
    "std_srvs/srv/Empty": (
        _EMPTY, _EMPTY, "5888399dedec5ccc85ea6451949fd2c9f97bfdf963f9a588821639fcd31b5d19",
    ),
    "std_srvs/srv/SetBool": (
        [("data", _BOOL)], _ANSWER,
        "abe9e4bb6b41b40e6789712c00ec8871923e089af3f667a79992a428cff2da0a",
    ),
    "std_srvs/srv/Trigger": (
        _EMPTY, _ANSWER, "eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f",
    ),
}  # fmt: skip
_RANGE = "sensor_msgs/msg/Range"

Distribution = Literal["humble", "jazzy"]
# Takes a message, and what /step calls with the time that it has reached.
Act = Callable[[Any, Callable[[float], None]], None]


@dataclass(frozen=True, eq=False)
class _Stream:
    """Topic, its Zenoh publisher, and the payloads and attachments that wait for its thread."""

    topic: Topic
    publisher: Any
    gid: bytes
    queue: deque[tuple[bytes, bytes]]
    ready: Event  # of its thread
    numbers: itertools.count[int] = field(default_factory=lambda: itertools.count(1))


class ZenohPublisher(Publisher):
    """Node of ROS 2, and the router of this computer's nodes if there is none.

    Nodes on this computer need only the environment variable `RMW_IMPLEMENTATION=rmw_zenoh_cpp`:
    the publisher replaces their router, `rmw_zenohd`, or joins one that runs. It listens on the
    loopback interface alone.

    Topics in: `/cmd_vel`, Twist or TwistStamped; `/set_pose`, PoseWithCovarianceStamped as in
    robot_localization. With several robots, both have the prefix `/<robot>`. Services: `/reset`,
    Empty; `/pause`, SetBool; `/step`, Trigger, which advances paused time by 0.1 s.

    Attributes:
        dropped: messages dropped because they waited too long.

    Args:
        endpoint: the router's address. On another computer, it must be running.
        domain: ROS domain; None: `ROS_DOMAIN_ID`, or 0.
        distribution: "humble", or "jazzy" and later. Nodes of one cannot hear the other.

    Raises:
        ServeError: endpoint or domain is malformed.
    """

    protocol = "ros2"

    def __init__(
        self,
        endpoint: str = ROUTER,
        domain: int | None = None,
        distribution: Distribution = "jazzy",
    ):
        if not re.fullmatch(r"(tcp|tls|quic|ws)/\S+:\d+", endpoint):
            raise ServeError(f"router: expected an endpoint such as {ROUTER}, got {endpoint!r}")
        named = os.environ.get("ROS_DOMAIN_ID") or "0" if domain is None else str(domain)
        if not re.fullmatch(r"\d{1,3}", named) or int(named) > 232:
            raise ServeError(f"ROS domain: expected 0 to 232, got {named!r}")
        self.endpoint, self.domain, self.distribution = endpoint, int(named), distribution
        self.dropped = 0
        self._streams: dict[str, _Stream] = {}
        self._commands: list[tuple[Any, str, Act]] = []  # with handler and type
        self._replies: deque[Callable[[], None]] = deque()
        self._numbers = itertools.count()
        self._declared: list[Any] = []  # a token ends with its object
        self._tokens: dict[str, None] = {}  # of all nodes, in order
        self._ready = {False: Event(), True: Event()}  # by whether messages are large
        self._threads: list[Thread] = []
        self._closing = Event()
        self._session: Any = None

    def open(self, topics: Sequence[Topic], controls: Controls) -> str:
        """Begin to serve; returns the line that tells people where.

        Raises:
            ServeError: the router cannot be reached, or another program has its port.
        """
        self._types = RosTypes(self.distribution)
        self._session, place = self._connect()
        self._zid = str(self._session.zid())
        self._declare("NN")
        for topic in topics:
            self._add_topic(topic)
        self._add_commands(controls)
        graph = self._session.liveliness().declare_subscriber(
            f"@ros2_lv/{self.domain}/**", zenoh.handlers.RingChannel(MAX_TOKENS), history=True
        )
        for work, argument in (self._send, False), (self._send, True), (self._receive, graph):
            thread = Thread(target=work, args=(argument,), name="ros2", daemon=True)
            thread.start()
            self._threads.append(thread)
        domain = f"ROS_DOMAIN_ID={self.domain} " * bool(self.domain)
        return f"ROS 2, {place}: {domain}RMW_IMPLEMENTATION=rmw_zenoh_cpp ros2 topic list"

    def _connect(self) -> tuple[zenoh.Session, str]:
        """Session, and the place that it has."""
        if not re.match(r"\w+/(localhost|127\.[\d.]+|\[::1\]):", self.endpoint):
            return self._join("client", []), f"router at {self.endpoint}"
        with suppress(zenoh.ZError):
            return _session(mode="router", listen={"endpoints": [self.endpoint]}), self.endpoint
        return self._join("peer", ["tcp/127.0.0.1:0"]), f"beside the router at {self.endpoint}"

    def _join(self, mode: str, listen: list[str]) -> zenoh.Session:
        connect = {"endpoints": [self.endpoint], "exit_on_failure": True, "timeout_ms": 3000}
        try:
            return _session(mode=mode, listen={"endpoints": listen}, connect=connect)
        except zenoh.ZError as error:
            reason = "is taken by another program" if mode == "peer" else "cannot be reached"
            expected = "expected a Zenoh router, such as `ros2 run rmw_zenoh_cpp rmw_zenohd`"
            raise ServeError(f"{self.endpoint} {reason}: {expected}") from error

    def _declare(self, kind: str, topic: Topic | None = None) -> bytes:
        """Declare a token of the node, or of a topic or service of it; returns its GID (16)."""
        # 0: the node's number; %: no enclave, no namespace
        token = f"@ros2_lv/{self.domain}/{self._zid}/0/{next(self._numbers)}/{kind}/%/%/{NODE}"
        if topic:
            reliability, durability = "2" * topic.is_best_effort, "1" * topic.is_latched
            depth = 1 if topic.is_latched else 5 if topic.is_best_effort else 10
            names = f"{topic.name.replace('/', '%')}/{self._types.names(topic.type)}"
            token += f"/{names}/{reliability}:{durability}:,{depth}:,:,:,,"
        self._declared.append(self._session.liveliness().declare_token(token))
        return xxhash.xxh3_128_intdigest(token.encode()).to_bytes(16, "little")

    def _add_topic(self, topic: Topic) -> None:
        is_large, kinds = topic.type.endswith(LARGE), zenoh.Reliability
        options: dict[str, Any] = {
            "congestion_control": zenoh.CongestionControl.DROP,
            "priority": zenoh.Priority.DATA_LOW if is_large else zenoh.Priority.DATA,
            "reliability": kinds.BEST_EFFORT if topic.is_best_effort else kinds.RELIABLE,
        }
        key = f"{self.domain}{topic.name}/{self._types.names(topic.type)}"
        if topic.is_latched:
            beat = zenoh.ext.MissDetectionConfig(heartbeat=None, sporadic_heartbeat=0.5)
            options |= {"cache": zenoh.ext.CacheConfig(1), "sample_miss_detection": beat}
            publisher: Any = zenoh.ext.declare_advanced_publisher(
                self._session, key, publisher_detection=True, **options
            )
        else:
            publisher = self._session.declare_publisher(key, **options)
        queue: deque[Any] = deque(maxlen=MAX_QUEUED_LARGE if is_large else MAX_QUEUED)
        gid = self._declare("MP", topic)
        self._streams[topic.name] = _Stream(topic, publisher, gid, queue, self._ready[is_large])

    def _add_commands(self, controls: Controls) -> None:
        for robot in controls.robots:
            prefix = f"/{robot}" if len(controls.robots) > 1 else ""

            def drive(message: Any, _: Any, robot: str = robot) -> None:
                twist = getattr(message, "twist", message)
                controls.command(robot, twist.linear.x, twist.angular.z)

            def place(message: Any, _: Any, robot: str = robot) -> None:
                at, turned = message.pose.pose.position, message.pose.pose.orientation
                x, y, z, w = turned.x, turned.y, turned.z, turned.w
                yaw_rad = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
                controls.set_pose(robot, at.x, at.y, yaw_rad)

            self._listen(f"{prefix}/cmd_vel", "geometry_msgs/msg/Twist", drive)
            self._listen(f"{prefix}/cmd_vel", "geometry_msgs/msg/TwistStamped", drive)
            self._listen(f"{prefix}/set_pose", "geometry_msgs/msg/PoseWithCovarianceStamped", place)
        self._listen("/reset", "std_srvs/srv/Empty", lambda _, then: controls.reset())
        self._listen("/pause", "std_srvs/srv/SetBool", lambda ask, then: controls.pause(ask.data))
        self._listen("/step", "std_srvs/srv/Trigger", lambda _, then: controls.step(STEP_S, then))

    def _listen(self, name: str, type_name: str, act: Act) -> None:
        topic, is_service = Topic(name, type_name), "/srv/" in type_name
        ring: Any = zenoh.handlers.RingChannel(MAX_REQUESTS if is_service else 1)
        key = f"{self.domain}{name}/{self._types.names(type_name)}"
        handler = (
            self._session.declare_queryable(key, ring, complete=True)
            if is_service
            else self._session.declare_subscriber(key, ring)
        )
        self._commands.append((handler, type_name, act))
        self._declare("SS" if is_service else "MS", topic)

    def wants(self, topic: str) -> bool:
        """True if a node subscribes to the topic, or late ones receive its last message."""
        stream = self._streams.get(topic)
        if stream is None or self._closing.is_set():
            return False
        return stream.topic.is_latched or stream.publisher.matching_status.matching

    def publish(self, topic: str, stamp_ns: int, message: Any) -> None:
        """Queue a message; if too many wait, the topic's oldest is dropped."""
        if not self.wants(topic):
            return
        stream = self._streams[topic]
        payload = self._types.encode(stream.topic.type, message)
        self.dropped += len(stream.queue) == stream.queue.maxlen
        stream.queue.append((payload, _attachment(next(stream.numbers), stream.gid)))
        stream.ready.set()

    def _send(self, is_large: bool) -> None:
        ready = self._ready[is_large]
        streams = [stream for stream in self._streams.values() if stream.ready is ready]
        while ready.wait() and not self._closing.is_set():
            ready.clear()
            for stream in streams:
                for _ in range(len(stream.queue)):
                    payload, attachment = stream.queue.popleft()
                    stream.publisher.put(payload, attachment=attachment)

    def _receive(self, graph: Any) -> None:
        while not self._closing.wait(POLL_S):
            for handler, type_name, act in self._commands:
                received = handler.try_recv()
                if isinstance(received, zenoh.Query):
                    self._call(received, handler.key_expr, type_name, act)
                elif received is not None:
                    with suppress(ServeError):  # nobody to tell
                        act(
                            self._types.decode(type_name, _limited(received.payload)),
                            lambda _: None,
                        )
            while self._replies:
                self._replies.popleft()()
            for change in itertools.islice(iter(graph.try_recv, None), MAX_REQUESTS):
                token = str(change.key_expr)
                if change.kind == zenoh.SampleKind.DELETE:
                    self._tokens.pop(token, None)
                elif len(self._tokens) < MAX_TOKENS and f"/{self._zid}/" not in token:
                    self._tokens[token] = None

    def _call(self, query: zenoh.Query, key: zenoh.KeyExpr, type_name: str, act: Act) -> None:
        def answer(success: bool, message: str) -> None:
            values = (0,) if type_name.endswith("/Empty") else (success, message)
            payload = self._types.encode(f"{type_name}_Response", values)
            attachment = _attachment(number, gid)
            self._replies.append(lambda: query.reply(key, payload, attachment=attachment))

        try:
            number, _, _, gid = _ATTACHMENT.unpack(_limited(query.attachment))
            request = self._types.decode(f"{type_name}_Request", _limited(query.payload))
            act(request, lambda now_s: answer(True, f"at {now_s:g} s"))
            if not type_name.endswith("/Trigger"):
                answer(True, "")
        except struct.error:
            query.reply_err("expected an attachment of rmw_zenoh")
        except ServeError as error:
            if type_name.endswith("/Empty"):
                query.reply_err(str(error))
            else:
                answer(False, str(error))

    @property
    def clients(self) -> list[Client]:
        """Other nodes of the domain."""
        names: dict[str, str] = {}
        topics: dict[str, list[str]] = defaultdict(list)
        pattern = r"@ros2_lv/\d+/(\w+/\d+)/\d+/(NN|MS)/[^/]+/([^/]+)/([^/]+)(?:/([^/]+)/.*)?"
        for token in list(self._tokens):
            if match := re.fullmatch(pattern, token):
                node, kind, namespace, name, topic = match.groups()
                if kind == "NN":
                    names[node] = f"{namespace.rstrip('%')}/{name}".replace("%", "/")
                elif topic:
                    topics[node].append(topic.replace("%", "/"))
        return [Client(self.protocol, name, tuple(topics[node])) for node, name in names.items()]

    def close(self) -> None:
        """Disconnect, and stop; a second call does nothing."""
        self._closing.set()
        for event in self._ready.values():
            event.set()
        for thread in self._threads:
            thread.join()
        if self._session is not None:
            self._session.close()


class RosTypes:
    """Types of a ROS 2 distribution.

    Args:
        distribution: "humble", which has no type hashes, or "jazzy", whose messages are also those
            of Kilted and Lyrical.
    """

    def __init__(self, distribution: Distribution):
        self._is_humble = distribution == "humble"
        self._store = get_typestore(Stores.ROS2_HUMBLE if self._is_humble else Stores.ROS2_JAZZY)
        others = {x: y for x, y in STORE.fielddefs.items() if x.startswith(LIVOX)}
        for name, (request, response, _) in _SERVICES.items():
            others |= {f"{name}_Request": ([], request), f"{name}_Response": ([], response)}
        self._store.register(others)

    def names(self, type_name: str) -> str:
        """Name and hash of a type in keys: std_msgs::msg::dds_::String_/RIHS01_ and 64 digits."""
        package, kind, name = type_name.split("/")
        if self._is_humble:
            hashed = "TypeHashNotSupported"
        elif type_name in _SERVICES:
            hashed = f"RIHS01_{_SERVICES[type_name][2]}"
        else:
            hashed = self._store.hash_rihs01(type_name)
        return f"{package}::{kind}::dds_::{name}_/{hashed}"

    def encode(self, type_name: str, message: Any) -> bytes:
        """CDR of a message of any distribution's class, or of a tuple of its values."""
        if isinstance(message, tuple):
            message = self._store.types[type_name](*message)
        elif type_name == _RANGE and not self._is_humble:  # Humble's has no variance
            message = self._store.types[type_name](**{"variance": 0.0, **vars(message)})
        elif type_name == LIVOX_CLOUD:  # with an array of records for its points
            return serialized(message)
        return bytes(self._store.serialize_cdr(message, type_name))

    def decode(self, type_name: str, payload: bytes) -> Any:
        """Message of CDR.

        Raises:
            ServeError: the bytes are no message of this type.
        """
        try:
            return self._store.deserialize_cdr(payload, type_name)
        except SerdeError as error:
            raise ServeError(f"expected a {type_name}") from error


def _session(**config: Any) -> zenoh.Session:
    settings = zenoh.Config()
    for key, value in (_CONFIG | config).items():
        settings.insert_json5(key, json.dumps(value))
    return zenoh.open(settings)


def _attachment(number: int, gid: bytes) -> bytes:
    return _ATTACHMENT.pack(number, time.time_ns(), len(gid), gid)


def _limited(payload: zenoh.ZBytes | None) -> bytes:
    return b"" if payload is None or len(payload) > MAX_COMMAND_BYTES else payload.to_bytes()
