"""ROS 2 over Zenoh: a node of zenoh-ros2-sdk in another process reads all messages."""

import importlib
import json
import random
import socket
import subprocess
import sys
import threading
import time
from contextlib import contextmanager

import numpy as np
import pytest

from omnisim.core.errors import ServeError
from omnisim.serve.publisher import Topic
from tests.serve.ros_client import ANSWER, EMPTY, plain

zenoh = pytest.importorskip("zenoh", reason="needs the extra zenoh")
xxhash = pytest.importorskip("xxhash", reason="needs the extra zenoh")
pytest.importorskip("rosbags", reason="needs the extra zenoh")
from omnisim.datasets.export.ros2 import ros_messages as messages  # noqa: E402
from omnisim.serve.protocols.zenoh_publisher import RosTypes, ZenohPublisher  # noqa: E402

WITHIN_S = 20

# As `ros2 topic info --verbose` prints them, or the nodes of other authors have them.
HASHES = {
    "std_msgs/msg/String": "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
    "sensor_msgs/msg/Image": "d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47",
    "sensor_msgs/msg/CameraInfo": (
        "b3dfd68ff46c9d56c80fd3bd4ed22c7a4ddce8c8348f2f59c299e73118e7e275"
    ),
    "sensor_msgs/msg/PointCloud2": (
        "9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5"
    ),
    "geometry_msgs/msg/Twist": "9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a",
    "sensor_msgs/msg/Range": "b42b62562e93cbfe9d42b82fe5994dfa3d63d7d5c90a317981703f7388adff3a",
    "tf2_msgs/msg/TFMessage": "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
    "nav_msgs/msg/OccupancyGrid": (
        "8d348150c12913a31ee0ec170fbf25089e4745d17035792a1ba94d6f0bc0cfc7"
    ),
    "std_srvs/srv/SetBool": "abe9e4bb6b41b40e6789712c00ec8871923e089af3f667a79992a428cff2da0a",
    "std_srvs/srv/Trigger": "eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f",
}


class RecordingControls:
    def __init__(self, robots=("robot",)):
        self.robots, self.calls, self.refusal = robots, [], ""

    def __getattr__(self, name):
        def call(*values):
            if self.refusal:
                raise ServeError(self.refusal)
            *values, then = values if name == "step" else (*values, None)
            self.calls.append((name, *values))
            if then:
                threading.Timer(0.1, then, (0.5,)).start()

        return call


def _free_port():
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


@contextmanager
def _served(topics=(), controls=None, **options):
    """Publisher, its endpoint and its controls."""
    endpoint = options.pop("endpoint", f"tcp/127.0.0.1:{_free_port()}")
    publisher, controls = ZenohPublisher(endpoint, **options), controls or RecordingControls()
    publisher.open(topics, controls)
    try:
        yield publisher, endpoint, controls
    finally:
        publisher.close()


@contextmanager
def _connected(endpoint, mode="client"):
    config = {"mode": mode, "scouting": {"multicast": {"enabled": False}}}
    if mode == "router":
        config["listen"] = {"endpoints": [endpoint]}
    else:
        config["connect"] = {"endpoints": [endpoint]}
    with zenoh.open(zenoh.Config.from_json5(json.dumps(config))) as session:
        yield session


def _until(condition):
    end_s = time.monotonic() + WITHIN_S
    while not (result := condition()):
        assert time.monotonic() < end_s, "nothing within the time"
        time.sleep(0.01)
    return result


def _tokens(session):
    replies = session.liveliness().get("@ros2_lv/**", timeout=2)
    return sorted(str(reply.ok.key_expr) for reply in replies if reply.ok)


def _examples():
    """Topics of a served robot, with a message each."""
    stamp, frame, count = 1_500_000_001, "camera", (4, 6)
    cloud = messages.point_fields([(axis, np.arange(5, dtype=np.float32)) for axis in "xyz"])
    fields = {"offset_time": "u4", **dict.fromkeys("xyz", "f4"), "reflectivity": "u1"}
    fields |= {"tag": "u1", "line": "u1"}
    livox = np.ones(3, np.dtype([*fields.items()], align=True))
    pose, values = np.eye(4), np.linspace(-1.0, 1.0, 3)
    header = messages.header(stamp, frame)
    from rosbags.typesys import Stores, get_typestore

    types = get_typestore(Stores.ROS2_HUMBLE).types
    origin = messages.odometry(stamp, ("a", "b"), pose, values, values).pose.pose
    grid = types["nav_msgs/msg/OccupancyGrid"](
        header,
        types["nav_msgs/msg/MapMetaData"](header.stamp, 0.0625, 3, 2, origin),
        np.array([0, 100, -1, 0, 100, -1], dtype=np.int8),
    )
    pixels = np.arange(72, dtype=np.uint8).reshape(*count, 3)
    k = np.array([200.0, 0, 3, 0, 200, 2, 0, 0, 1])
    info = types["sensor_msgs/msg/CameraInfo"](
        header, 4, 6, "plumb_bob", np.zeros(5), k, np.eye(3).ravel(), np.zeros(12), 0, 0,
        types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False),
    )  # fmt: skip
    sent = [
        ("/front/image_raw", messages.image(stamp, frame, pixels), "best effort"),
        ("/front/image_raw/compressed", messages.compressed_image(stamp, frame, b"jpeg"), ""),
        ("/front/camera_info", info, ""),
        ("/front/calibration", messages.text("{}"), "latched"),
        ("/lidar/points", messages.point_cloud(stamp, frame, cloud), "best effort"),
        ("/livox/points", messages.livox_cloud(stamp, frame, livox), "best effort"),
        (
            "/scanner/scan",
            messages.laser_scan(stamp, frame, values, np.array([1.0, 2, np.inf]), (0.125, 30.0)),
            "best effort",
        ),
        ("/imu/data_raw", messages.imu(stamp, frame, values, values), "best effort"),
        (
            "/sonar/range",
            messages.range_message(stamp, frame, 0.25, (0.125, 4.0), 1.5),
            "best effort",
        ),
        ("/odom", messages.odometry(stamp, ("odom", "base_link"), pose, values, values), ""),
        ("/tf", messages.transforms(stamp, {("map", "odom"): pose}), ""),
        ("/tf_static", messages.transforms(stamp, {("base_link", frame): pose}), "latched"),
        ("/map", grid, "latched"),
        ("/robot_description", messages.text("<robot name='r'/>"), "latched"),
        ("/clock", types["rosgraph_msgs/msg/Clock"](header.stamp), "best effort"),
    ]
    return [
        (Topic(name, message.__msgtype__, kind == "latched", kind == "best effort"), message)
        for name, message, kind in sent
    ]


@pytest.mark.slow
def test_another_node_reads_every_message_commands_and_calls_services():
    pytest.importorskip("zenoh_ros2_sdk", reason="needs zenoh-ros2-sdk")
    examples = _examples()
    with _served([topic for topic, _ in examples]) as (publisher, endpoint, controls):
        topics = {topic.name: (topic.type, topic.is_latched) for topic, _ in examples}
        request = {"port": int(endpoint.rpartition(":")[2]), "topics": topics}
        for topic, message in examples:
            publisher.publish(topic.name, 0, message)  # only latched ones are kept
        with subprocess.Popen(
            [sys.executable, "-m", "tests.serve.ros_client", json.dumps(request)],
            stdout=subprocess.PIPE, text=True,
        ) as node:  # fmt: skip
            while node.poll() is None:
                for topic, message in examples:
                    # the SDK asks for latched messages, but not of names with two parts
                    if not topic.is_latched or topic.name.count("/") > 1:
                        publisher.publish(topic.name, 0, message)
                time.sleep(0.05)
            output = json.loads(node.stdout.read())
    for topic, message in examples:
        expected = plain(message)
        if topic.type.endswith("/Range"):
            expected["variance"] = 0.0  # Jazzy's
        assert output["messages"][topic.name] == json.loads(json.dumps(expected)), topic.name
    drive, stamped, placed, *called = controls.calls
    assert drive == ("command", "robot", 0.5, 0.25)
    assert stamped == ("command", "robot", -1.0, 0.0)
    assert placed[:4] == ("set_pose", "robot", 1.0, 2.0)
    assert placed[4] == pytest.approx(2 * np.arctan2(0.6, 0.8), abs=1e-12)
    assert called == [("pause", True), ("step", 0.1), ("reset",)]
    assert output["answers"]["/pause"] == {"success": True, "message": ""}
    assert output["answers"]["/step"] == {"success": True, "message": "at 0.5 s"}
    assert output["answers"]["/reset"] is not None
    listed, services = map(dict, output["listed"])
    assert listed.keys() >= topics.keys() | {"/cmd_vel", "/set_pose"}
    assert all(listed[name] == [type_name] for name, (type_name, _) in topics.items())
    assert services["/pause"] == ["std_srvs/srv/SetBool"]


def test_hashes_are_those_of_ros():
    types = RosTypes("jazzy")
    for type_name, digits in HASHES.items():
        assert types.names(type_name).endswith(f"_/RIHS01_{digits}"), type_name
    assert types.names("std_msgs/msg/String").startswith("std_msgs::msg::dds_::String_/")
    humble = RosTypes("humble").names("std_srvs/srv/Trigger")
    assert humble == "std_srvs::srv::dds_::Trigger_/TypeHashNotSupported"


def test_hashes_of_services_are_those_that_the_sdk_computes():
    utils = pytest.importorskip("zenoh_ros2_sdk.utils", reason="needs zenoh-ros2-sdk")
    types = RosTypes("jazzy")
    for name, parts in (
        ("Empty", (EMPTY, EMPTY)), ("SetBool", ("bool data", ANSWER)), ("Trigger", (EMPTY, ANSWER))
    ):  # fmt: skip
        type_name = f"std_srvs/srv/{name}"
        expected = utils.compute_service_type_hash(type_name, *parts)
        assert types.names(type_name) == f"std_srvs::srv::dds_::{name}_/{expected}"


def test_humble_has_a_range_without_variance():
    sent = messages.range_message(1, "sonar", 0.25, (0.125, 4.0), 1.5)
    sizes = {
        name: len(RosTypes(name).encode("sensor_msgs/msg/Range", sent))
        for name in ("humble", "jazzy")
    }
    assert sizes["jazzy"] == sizes["humble"] + 4


def test_tokens_and_attachments_are_those_of_the_middleware():
    topics = [
        Topic("/front/image_raw", "sensor_msgs/msg/Image", is_best_effort=True),
        Topic("/tf_static", "tf2_msgs/msg/TFMessage", is_latched=True),
    ]
    pixels = messages.image(1, "front", np.zeros((2, 2, 3), dtype=np.uint8))
    with _served(topics, domain=3) as (publisher, endpoint, _), _connected(endpoint) as session:
        tokens = _until(lambda: len(found := _tokens(session)) > 8 and found)
        zid = tokens[0].split("/")[2]
        kinds = {token.split("/")[5]: token for token in tokens}
        assert sorted(token.split("/")[5] for token in tokens) == [
            "MP", "MP", "MS", "MS", "MS", "NN", "SS", "SS", "SS",
        ]  # fmt: skip
        assert kinds["NN"] == f"@ros2_lv/3/{zid}/0/0/NN/%/%/omnisim"
        image = f"RIHS01_{HASHES['sensor_msgs/msg/Image']}"
        token = (
            f"@ros2_lv/3/{zid}/0/1/MP/%/%/omnisim/%front%image_raw/sensor_msgs::msg::dds_::Image_/"
            f"{image}/2::,5:,:,:,,"
        )
        assert token in tokens
        (latched,) = (each for each in tokens if "MP/%/%/omnisim/%tf_static/" in each)
        assert latched.endswith("/:1:,1:,:,:,,")
        assert kinds["SS"].endswith("/::,10:,:,:,,")
        key = f"3/front/image_raw/sensor_msgs::msg::dds_::Image_/{image}"
        subscriber = session.declare_subscriber(key, zenoh.handlers.RingChannel(5))
        _until(lambda: publisher.wants("/front/image_raw"))
        for _ in range(2):
            publisher.publish("/front/image_raw", 1, pixels)
        samples = [_until(subscriber.try_recv) for _ in range(2)]
        for number, sample in enumerate(samples, 1):
            attachment = sample.attachment.to_bytes()
            assert len(attachment) == 33
            assert int.from_bytes(attachment[:8], "little") == number
            sent_ns = int.from_bytes(attachment[8:16], "little")
            assert abs(time.time_ns() - sent_ns) < WITHIN_S * 1e9
            digest = xxhash.xxh3_128(token.encode()).digest()[::-1]
            assert attachment[16:] == bytes([16]) + digest
        assert sample.congestion_control == zenoh.CongestionControl.DROP


def test_late_nodes_receive_latched_messages():
    topic = Topic("/tf_static", "tf2_msgs/msg/TFMessage", is_latched=True)
    with _served([topic]) as (publisher, endpoint, _):
        for name in ("first", "last"):
            static = messages.transforms(1, {("base_link", name): np.eye(4)})
            publisher.publish("/tf_static", 1, static)
        time.sleep(0.3)
        with _connected(endpoint) as session:
            names = RosTypes("jazzy").names(topic.type)
            late = zenoh.ext.declare_advanced_subscriber(
                session, f"0/tf_static/{names}", zenoh.handlers.RingChannel(5),
                history=zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=1),
            )  # fmt: skip
            sample = _until(late.try_recv)
    transforms = RosTypes("jazzy").decode(topic.type, sample.payload.to_bytes())
    assert transforms.transforms[0].child_frame_id == "last"


@pytest.mark.parametrize("mode", ["client", "peer"])
def test_only_wanted_topics_are_wanted(mode):
    topic = Topic("/odom", "nav_msgs/msg/Odometry")
    with _served([topic]) as (publisher, endpoint, _), _connected(endpoint, mode) as session:
        assert not publisher.wants("/odom")
        assert not publisher.wants("/unknown")
        names = RosTypes("jazzy").names(topic.type)
        subscriber = session.declare_subscriber(f"0/odom/{names}")
        _until(lambda: publisher.wants("/odom"))
        subscriber.undeclare()
        _until(lambda: not publisher.wants("/odom"))


def test_nodes_are_clients_while_they_live():
    with _served([Topic("/odom", "nav_msgs/msg/Odometry")]) as (publisher, endpoint, _):
        assert publisher.clients == []
        with _connected(endpoint) as session:
            node = f"@ros2_lv/0/{session.zid()}/7"
            names = RosTypes("jazzy").names("nav_msgs/msg/Odometry")
            held = [
                session.liveliness().declare_token(token)
                for token in (
                    f"{node}/7/NN/%/%nav/planner",
                    f"{node}/8/MS/%/%nav/planner/%odom/{names}/::,10:,:,:,,",
                    "@ros2_lv/0/malformed",
                    f"{node}/9/MS/%/%nav",
                )
            ]
            client = _until(lambda: publisher.clients and publisher.clients[0].topics)
            assert client == ("/odom",)
            assert [each.name for each in publisher.clients] == ["/nav/planner"]
            assert len(held) == 4
        _until(lambda: publisher.clients == [])


def test_a_publisher_joins_a_router_that_runs():
    endpoint = f"tcp/127.0.0.1:{_free_port()}"
    with (
        _connected(endpoint, "router"),
        _served([], endpoint=endpoint) as (_, _, controls),
        _connected(endpoint, "peer") as session,
    ):
        key = f"0/cmd_vel/{RosTypes('jazzy').names('geometry_msgs/msg/Twist')}"
        publisher = session.declare_publisher(key)
        _until(lambda: publisher.matching_status.matching)
        publisher.put(_twist(1.5))
        assert _until(lambda: controls.calls) == [("command", "robot", 1.5, 0.0)]


@pytest.mark.slow
def test_nodes_receive_again_after_a_restart():
    topic = Topic("/map", "nav_msgs/msg/OccupancyGrid", is_latched=True)
    (grid,) = (message for each, message in _examples() if each.name == "/map")
    endpoint = f"tcp/127.0.0.1:{_free_port()}"
    with _connected(endpoint, "peer") as session:  # before there is a router
        received = zenoh.ext.declare_advanced_subscriber(
            session, f"0/map/{RosTypes('jazzy').names(topic.type)}", zenoh.handlers.RingChannel(9),
            history=zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=1),
        )  # fmt: skip
        for _ in range(2):
            with _served([topic], endpoint=endpoint) as (publisher, _, _):
                publisher.publish("/map", 1, grid)
                _until(received.try_recv)


def test_several_robots_have_prefixes():
    controls = RecordingControls(("a", "b"))
    with _served(controls=controls) as (_, endpoint, _), _connected(endpoint) as session:
        key = f"0/b/cmd_vel/{RosTypes('jazzy').names('geometry_msgs/msg/Twist')}"
        session.put(key, _twist(-0.5))
        assert _until(lambda: controls.calls) == [("command", "b", -0.5, 0.0)]


def test_refusals_are_answered():
    types = RosTypes("jazzy")
    with _served() as (_, endpoint, controls), _connected(endpoint) as session:
        controls.refusal = "time is not paused"

        def ask(name, type_name, payload, attachment=bytes(16) + bytes([16]) + bytes(16)):
            key = f"0/{name}/{types.names(type_name)}"
            (reply,) = session.get(key, payload=payload, attachment=attachment, timeout=WITHIN_S)
            return reply

        empty = types.encode("std_srvs/srv/Empty_Request", (0,))
        _until(lambda: len(_tokens(session)) > 6)
        answer = types.decode(
            "std_srvs/srv/Trigger_Response",
            ask("step", "std_srvs/srv/Trigger", empty).ok.payload.to_bytes(),
        )
        assert (answer.success, answer.message) == (False, "time is not paused")
        reset = ask("reset", "std_srvs/srv/Empty", empty)
        assert reset.err.payload.to_string() == "time is not paused"
        bad = ask("step", "std_srvs/srv/Trigger", empty, attachment=b"short")
        assert "attachment" in bad.err.payload.to_string()
        controls.refusal = ""
        bad = ask("reset", "std_srvs/srv/Empty", b"")
        assert bad.err.payload.to_string() == "expected a std_srvs/srv/Empty_Request"
        assert controls.calls == []


@pytest.mark.slow
def test_damaged_commands_end_nothing():
    types, chance = RosTypes("jazzy"), random.Random(1)
    stamped = types.encode(
        "geometry_msgs/msg/TwistStamped",
        (messages.header(1, "base_link"), types.decode("geometry_msgs/msg/Twist", _twist(1.0))),
    )
    with _served() as (_, endpoint, controls), _connected(endpoint) as session:
        keys = [f"0/cmd_vel/{types.names('geometry_msgs/msg/TwistStamped')}"]
        keys += [f"0/step/{types.names('std_srvs/srv/Trigger')}"]
        name = "geometry_msgs/msg/PoseWithCovarianceStamped"
        keys += [f"0/set_pose/{types.names(name)}"]
        _until(lambda: len(_tokens(session)) > 6)
        for _ in range(10_000):
            damaged = bytearray(stamped)
            for _ in range(chance.randrange(1, 8)):
                damaged[chance.randrange(len(damaged))] = chance.randrange(256)
            cut = bytes(damaged[: chance.randrange(len(damaged) + 1)])
            session.put(keys[0], cut * chance.choice((1, 1, 1000)))
            session.put(keys[2], (bytes(damaged) + stamped * 5)[: chance.randrange(400)])
            session.get(keys[1], payload=cut, attachment=cut[:33], timeout=0.1)
        time.sleep(0.5)
        controls.calls.clear()
        session.put(f"0/cmd_vel/{types.names('geometry_msgs/msg/Twist')}", _twist(2.0))
        _until(lambda: ("command", "robot", 2.0, 0.0) in controls.calls)


def _twist(speed_mps):
    types = RosTypes("jazzy")
    moving = messages.odometry(1, ("a", "b"), np.eye(4), (speed_mps, 0, 0), (0, 0, 0))
    return types.encode("geometry_msgs/msg/Twist", moving.twist.twist)


def test_a_port_of_another_program_is_refused():
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        endpoint = f"tcp/127.0.0.1:{other.getsockname()[1]}"
        with pytest.raises(ServeError, match=f"{endpoint} is taken by another program"):
            ZenohPublisher(endpoint).open([], RecordingControls())


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"endpoint": "localhost:7447"},
            "router: expected an endpoint such as tcp/127.0.0.1:7447, got",
        ),
        ({"domain": 233}, "ROS domain: expected 0 to 232, got '233'"),
        ({"domain": -1}, "ROS domain: expected 0 to 232, got '-1'"),
    ],
)
def test_settings_that_cannot_be(options, message):
    with pytest.raises(ServeError, match=message):
        ZenohPublisher(**options)


def test_the_domain_is_that_of_the_environment(monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", "42")
    assert ZenohPublisher().domain == 42
    assert ZenohPublisher(domain=1).domain == 1
    monkeypatch.setenv("ROS_DOMAIN_ID", "")
    assert ZenohPublisher().domain == 0


def test_a_missing_extra_is_named(monkeypatch):
    monkeypatch.setattr("omnisim.core.extras.is_installed", lambda module: module != "zenoh")
    monkeypatch.delitem(sys.modules, "omnisim.serve.protocols.zenoh_publisher")
    with pytest.raises(ServeError, match=r"needs eclipse-zenoh: pip install '.*\[zenoh\]'"):
        importlib.import_module("omnisim.serve.protocols.zenoh_publisher")


def test_the_oldest_messages_are_dropped_and_counted():
    topic = Topic("/tf_static", "tf2_msgs/msg/TFMessage", is_latched=True)
    publisher = ZenohPublisher(f"tcp/127.0.0.1:{_free_port()}")
    publisher.close()  # before `open`
    publisher = ZenohPublisher(f"tcp/127.0.0.1:{_free_port()}")
    publisher._send = lambda _: None  # nothing is sent
    publisher.open([topic], RecordingControls())
    for number in range(250):
        static = messages.transforms(number, {("base_link", "camera"): np.eye(4)})
        publisher.publish(topic.name, number, static)
    assert publisher.dropped == 50
    publisher.close()
    publisher.close()
    publisher.publish(topic.name, 0, static)
    assert publisher.dropped == 50
