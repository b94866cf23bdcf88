"""Foxglove's server: what a client that is not ours reads, asks for, and may not do."""

import socket
import time

import numpy as np
import pytest
from websockets.exceptions import InvalidStatus

pytest.importorskip("foxglove", reason="foxglove-sdk is not installed")
from omnisim.core.errors import ServeError
from omnisim.serve import access
from omnisim.serve.protocols import foxglove_publisher as module
from omnisim.serve.protocols.foxglove_publisher import MAX_QUEUE, FoxglovePublisher
from tests.serve import fake_robot
from tests.serve.foxglove_client import FoxgloveClient

STAMP_NS = fake_robot.STAMP_NS
ALL = tuple(fake_robot.messages())


@pytest.fixture
def controls():
    return fake_robot.FakeControls()


@pytest.fixture
def publisher(controls):
    server = FoxglovePublisher(port=0)
    server.open(fake_robot.topics(), controls)
    yield server
    server.close()


def wait_for(condition, seconds=10.0):
    end_s = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end_s, "waited in vain"
        time.sleep(0.01)


def received(publisher, *topics):
    """Decoded messages of topics, by name."""
    found, sent = {}, fake_robot.messages()
    with FoxgloveClient(publisher.url) as client:
        client.subscribe(*topics)
        wait_for(lambda: publisher.clients and set(publisher.clients[0].topics) == set(topics))
        wait_for(lambda: all(publisher.wants(topic) for topic in topics))
        for topic in topics:
            publisher.publish(topic, STAMP_NS, sent[topic])
        while len(found) < len(topics):
            topic, time_ns, content = client.message()
            assert time_ns == STAMP_NS
            found[topic] = content
    return found


def test_every_message_has_foxgloves_schema_or_that_of_ros(publisher):
    with FoxgloveClient(publisher.url) as client:
        schemas = {topic: client.channel(topic)["schemaName"] for topic in ALL}
    assert schemas == {
        "/front/image_raw": "foxglove.RawImage",
        "/front/instance": "foxglove.RawImage",
        "/front/image_raw/compressed": "foxglove.CompressedImage",
        "/front/camera_info": "foxglove.CameraCalibration",
        "/front/calibration": "std_msgs/msg/String",
        "/lidar/points": "foxglove.PointCloud",
        "/laser/scan": "foxglove.LaserScan",
        "/imu/data_raw": "sensor_msgs/msg/Imu",
        "/sonar/range": "sensor_msgs/msg/Range",
        "/odom": "foxglove.PoseInFrame",
        "/ground_truth/pose": "foxglove.PoseInFrame",
        "/tf": "foxglove.FrameTransforms",
        "/tf_static": "foxglove.FrameTransforms",
        "/map": "foxglove.Grid",
        "/robot_description": "std_msgs/msg/String",
    }


def test_every_message_arrives_with_its_content(publisher):
    sent, found = fake_robot.messages(), received(publisher, *ALL)

    image = found["/front/image_raw"]
    assert (image.width, image.height, image.step) == (64, 48, 192)
    assert (image.encoding, image.frame_id) == ("rgb8", "front_optical_frame")
    assert image.data == sent["/front/image_raw"].data.tobytes()
    assert image.timestamp.ToNanoseconds() == STAMP_NS
    labels = found["/front/instance"]
    assert (labels.encoding, labels.step) == ("32FC1", 256)
    values = np.frombuffer(labels.data, "<f4").astype("<i4")
    assert values.tobytes() == sent["/front/instance"].data.tobytes()
    assert found["/front/image_raw/compressed"].data == b"\x89PNG..."
    assert found["/front/image_raw/compressed"].format == "png"

    lens, info = fake_robot.LENS, found["/front/camera_info"]
    assert (info.width, info.height, info.distortion_model) == (64, 48, "kannala_brandt")
    assert tuple(info.D) == lens.coefficients
    assert list(info.K) == [20.0, 0.0, 31.5, 0.0, 21.0, 23.0, 0.0, 0.0, 1.0]
    assert list(info.R) == np.eye(3).ravel().tolist()
    assert list(info.P)[:3] == [20.0, 0.0, 31.5]

    cloud, points = found["/lidar/points"], fake_robot.cloud_points()
    kinds = {1: "u1", 3: "u2", 7: "f4", 8: "f8"}
    read = np.frombuffer(
        cloud.data,
        np.dtype(
            {
                "names": [field.name for field in cloud.fields],
                "formats": [kinds[field.type] for field in cloud.fields],
                "offsets": [field.offset for field in cloud.fields],
                "itemsize": cloud.point_stride,
            }
        ),
    )
    assert all(np.array_equal(read[name], points[name]) for name in points.dtype.names)
    assert cloud.pose.orientation.w == 1.0

    scan = found["/laser/scan"]
    assert (scan.start_angle, scan.end_angle) == (-0.5, 0.5)
    assert list(scan.ranges) == [1.0, 2.0, np.inf]

    for topic in ("/odom", "/ground_truth/pose"):
        pose = found[topic].pose
        assert (pose.position.x, pose.position.y, pose.position.z) == (1.5, -2.0, 0.25)
        assert pose.orientation.z == pytest.approx(np.sqrt(0.5))
    assert found["/odom"].frame_id == "odom"

    frames = [(one.parent_frame_id, one.child_frame_id) for one in found["/tf"].transforms]
    assert frames == [("map", "odom"), ("odom", "base_link")]
    assert found["/tf"].transforms[1].translation.x == 1.5
    assert found["/tf"].transforms[1].rotation.w == pytest.approx(np.sqrt(0.5))

    grid = found["/map"]
    cells = np.frombuffer(grid.data, np.uint8).reshape(2, grid.row_stride // grid.cell_stride, 4)
    assert (grid.column_count, grid.cell_size.x, grid.cell_size.y) == (3, 0.5, 0.5)
    assert [field.name for field in grid.fields] == ["red", "green", "blue", "alpha"]
    assert cells[..., 0].tolist() == [[205, 255, 0], [128, 255, 205]]
    assert (cells[..., 3] == 255).all()

    assert found["/imu/data_raw"].linear_acceleration.z == 9.81
    assert found["/imu/data_raw"].orientation_covariance[0] == -1.0
    assert found["/sonar/range"].range == 1.25
    assert found["/robot_description"].data == "<robot name='r'/>"


def test_only_what_somebody_receives_is_wanted(publisher):
    assert not publisher.wants("/imu/data_raw")
    assert not publisher.wants("/clock")
    assert publisher.wants("/map")  # may be asked for later
    with FoxgloveClient(publisher.url) as client:
        client.subscribe("/imu/data_raw")
        wait_for(lambda: publisher.wants("/imu/data_raw"))
        assert publisher.wants("/clock")
        assert not publisher.wants("/odom")
        (about,) = publisher.clients
        assert (about.protocol, about.topics, about.dropped) == ("foxglove", ("/imu/data_raw",), 0)
        client.unsubscribe("/imu/data_raw")
        wait_for(lambda: not publisher.wants("/imu/data_raw"))
        assert publisher.clients[0].topics == ()
    wait_for(lambda: not publisher.clients)


def test_late_subscribers_receive_latched_messages(publisher):
    for topic in fake_robot.LATCHED:
        publisher.publish(topic, STAMP_NS, fake_robot.messages()[topic])
    with FoxgloveClient(publisher.url) as client:
        client.subscribe(*fake_robot.LATCHED)
        assert {client.message()[0] for _ in fake_robot.LATCHED} == set(fake_robot.LATCHED)


def test_the_clock_is_the_servers_time(publisher):
    with FoxgloveClient(publisher.url) as client:
        assert "time" in client.info["capabilities"]
        wait_for(lambda: publisher.wants("/clock"))
        publisher.publish("/clock", STAMP_NS, None)
        assert int.from_bytes(client.binary(2), "little") == STAMP_NS


def test_panels_command_the_robot(publisher, controls):
    twist = {"linear": {"x": 0.5, "y": 0, "z": 0}, "angular": {"x": 0, "y": 0, "z": -1}}
    with FoxgloveClient(publisher.url) as client:
        client.advertise(1, "/cmd_vel")
        client.publish(1, twist)
        client.advertise(2, "/cmd_vel", "geometry_msgs/msg/TwistStamped")
        client.publish(2, {"header": {"frame_id": "base_link"}, "twist": twist})
        wait_for(lambda: len(controls.calls) == 2)
    assert controls.calls == [("command", "robot", 0.5, -1.0)] * 2


@pytest.mark.parametrize(
    ("content", "text"),
    [
        (b"{", "cmd_vel: expected a JSON object"),
        (b"[" * 60_000, "cmd_vel: expected a JSON object"),
        ({"linear": {"x": 1}}, "cmd_vel: angular: missing"),
        (b'{"linear": {"x": NaN}, "angular": {"z": 0}}', "cmd_vel: linear.x: expected a finite"),
        ({"linear": {"x": "fast"}, "angular": {"z": 0}}, "cmd_vel: linear.x: expected a number"),
    ],
)
def test_a_wrong_command_is_answered_by_a_line(publisher, controls, content, text):
    with FoxgloveClient(publisher.url) as client:
        client.advertise(1, "/cmd_vel")
        client.publish(1, content)
        status = client.json("status")
    assert status["message"].startswith(text)
    assert "\n" not in status["message"]
    assert controls.calls == []


def test_a_topic_that_nobody_reads_is_answered_by_a_line(publisher):
    with FoxgloveClient(publisher.url) as client:
        client.advertise(1, "/goal")
        assert "/goal" in (text := client.json("status")["message"])
        assert "/cmd_vel" in text


def test_services(publisher, controls):
    done = {"success": True, "message": ""}
    with FoxgloveClient(publisher.url) as client:
        refused = client.call("/step", {"seconds": 0.5})
        assert refused == {"success": False, "message": "step: expected paused time"}
        assert client.call("/pause", {}) == done
        assert client.call("/step", {"seconds": 0.5}) == done
        assert client.call("/pause", {"is_paused": False}) == done
        assert client.call("/set_pose", {"x_m": 1, "y_m": -2.5, "yaw_rad": 0.5}) == done
        assert client.call("/reset", {}) == done
        wrong = client.call("/set_pose", {"x_m": "a"})
        assert wrong["message"].startswith("/set_pose: x_m: expected a number, got 'a'; ")
        assert "seconds" in client.service("/step")["request"]["schema"]
    assert controls.calls == [
        ("pause", True), ("step", 0.5), ("pause", False),
        ("set_pose", "robot", 1.0, -2.5, 0.5), ("reset",),
    ]  # fmt: skip


def test_the_parameter_paused(publisher, controls):
    def values(received):
        return [(one["name"], one["value"]) for one in received["parameters"]]

    with FoxgloveClient(publisher.url) as client:
        client.send({"op": "getParameters", "parameterNames": [], "id": "a"})
        assert values(client.json("parameterValues")) == [("paused", False)]
        pause = {"name": "paused", "value": True}
        client.send({"op": "setParameters", "parameters": [pause], "id": "b"})
        assert values(client.json("parameterValues")) == [("paused", True)]
        assert controls.calls == [("pause", True)]
        client.send({"op": "subscribeParameterUpdates", "parameterNames": ["paused"]})
        wrong = {"name": "speed", "value": 3}
        client.send({"op": "setParameters", "parameters": [wrong], "id": "c"})
        assert "speed" in client.json("status")["message"]
        time.sleep(2 * module.TICK_S)
        controls.is_paused = False  # by another protocol
        while values(client.json("parameterValues")) != [("paused", False)]:
            pass


def test_each_of_several_robots_has_its_own_topics():
    controls = fake_robot.FakeControls("anna", "bert")
    server = FoxglovePublisher(port=0)
    server.open(fake_robot.topics(), controls)
    twist = {"linear": {"x": 1}, "angular": {"z": 2}}
    with FoxgloveClient(server.url) as client:
        for number, topic in enumerate(("/cmd_vel", "/anna/cmd_vel", "/bert/cmd_vel")):
            client.advertise(number, topic)
            client.publish(number, twist)
        wait_for(lambda: len(controls.calls) == 3)
        client.call("/bert/set_pose", {"x_m": 1, "y_m": 2})
    server.close()
    commands = [("command", name, 1.0, 2.0) for name in ("anna", "anna", "bert")]
    assert controls.calls == [*commands, ("set_pose", "bert", 1.0, 2.0, 0.0)]


def test_clients_of_the_former_protocol_are_served(publisher):
    with FoxgloveClient(publisher.url, "foxglove.websocket.v1") as client:
        assert client.subprotocol == "foxglove.websocket.v1"
        client.subscribe("/odom")
        wait_for(lambda: publisher.wants("/odom"))


@pytest.mark.parametrize("origin", ["https://app.foxglove.dev", "http://localhost:8080", "file://"])
def test_foxglove_and_pages_of_this_machine_may_connect(publisher, origin):
    FoxgloveClient(publisher.url, origin=origin).close()


@pytest.mark.parametrize(
    "options",
    [
        {"origin": "https://evil.example"},
        {"origin": "null"},
        {"origin": "http://["},
        {"additional_headers": {"Host": "evil.example"}, "origin": "http://evil.example"},
    ],
)
def test_other_websites_may_not(publisher, options):
    if host := options.pop("additional_headers", None):
        url = publisher.url.replace("localhost", host["Host"])
        options["address"] = "localhost", int(url.rpartition(":")[2])
    else:
        url = publisher.url
    with pytest.raises(InvalidStatus, match="403"):
        FoxgloveClient(url, **options)
    assert publisher.clients == []


def test_elsewhere_a_token_is_needed():
    server = FoxglovePublisher(host="0.0.0.0", port=0)
    server.open(fake_robot.topics(), fake_robot.FakeControls())
    address, token = server.url.split("/?token=")
    assert len(token) > 20
    FoxgloveClient(server.url, origin="https://lichtblick.example").close()
    for url in (address, f"{address}/?token=", f"{address}/?token={token[:-1]}é"):
        with pytest.raises(InvalidStatus, match="401") as refusal:
            FoxgloveClient(url)
        assert refusal.value.response.body.count(b"\n") == 1
    server.close()


def test_a_port_in_use_is_one_line():
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        server = FoxglovePublisher("127.0.0.1", port)
        with pytest.raises(ServeError, match=rf"^--port {port}: cannot listen on 127.0.0.1: .+$"):
            server.open(fake_robot.topics(), fake_robot.FakeControls())
        assert not server.wants("/imu/data_raw")
        server.close()


def test_a_host_elsewhere_is_one_line():
    with pytest.raises(ServeError, match=r"^--port 0: cannot listen on 192\.0\.2\.1: .+$"):
        FoxglovePublisher("192.0.2.1", 0).open(fake_robot.topics(), fake_robot.FakeControls())


def test_a_missing_extra_is_one_line(monkeypatch):
    import importlib

    from omnisim.core import extras

    monkeypatch.setattr(extras, "is_installed", lambda module: module != "foxglove")
    with pytest.raises(ServeError, match=r"^[^\n]+ needs foxglove-sdk: pip install [^\n]+$"):
        importlib.reload(module)


def test_closing_twice_and_publishing_after_it_do_nothing(publisher):
    client = FoxgloveClient(publisher.url)
    publisher.close()
    publisher.close()
    publisher.publish("/odom", 0, fake_robot.messages()["/odom"])
    publisher.publish("/clock", 0, None)
    assert not publisher.wants("/odom")
    client.close()


def test_a_client_that_reads_nothing_drops_only_its_own_messages(publisher):
    """The queue of one is bounded and its drops are counted; the other has every message."""
    image, count = fake_robot.messages()["/front/image_raw"], 2500
    with FoxgloveClient(publisher.url, max_queue=1) as idle, FoxgloveClient(publisher.url) as other:
        for client in (idle, other):
            client.subscribe("/front/image_raw")
        wait_for(lambda: sum(len(one.topics) for one in publisher.clients) == 2)
        wait_for(lambda: publisher.wants("/front/image_raw"))
        time.sleep(0.2)
        for number in range(count):  # 23 MB: more than all buffers on the way
            publisher.publish("/front/image_raw", number, image)
            if number % 50 == 49:
                while other.message()[1] != number:
                    pass
        idle.die()  # it would read everything in order to close
        slow, quick = sorted(publisher.clients, key=lambda one: -one.dropped)
    assert slow.dropped > count // 4
    assert quick.dropped == 0


def test_floods_wait_while_others_are_served(publisher, controls, monkeypatch):
    """At most MAX_MESSAGES_PER_S commands of one client are carried out, after a burst."""
    monkeypatch.setattr(access, "MAX_BYTES_PER_S", 1 << 20)
    twist = {"linear": {"x": 1}, "angular": {"z": 2}}
    with FoxgloveClient(publisher.url) as flood, FoxgloveClient(publisher.url) as other:
        flood.advertise(1, "/cmd_vel")
        began_s = time.monotonic()
        for _ in range(600):
            flood.publish(1, twist)
        assert other.call("/reset", {})["success"]
        wait_for(lambda: len(controls.calls) == 601)
        assert time.monotonic() - began_s > 300 / module.MAX_MESSAGES_PER_S


def test_a_clients_bytes_wait_their_turn(publisher):
    """Pings, too; what is read at once, up to 32 KiB, is not delayed."""
    with FoxgloveClient(publisher.url) as client:
        began_s = time.monotonic()
        for _ in range(600):
            client.ping(bytes(125))  # 131 bytes with their headers
        assert client.call("/reset", {})["success"]
        assert time.monotonic() - began_s > (600 * 131 - (1 << 15)) / access.MAX_BYTES_PER_S - 0.2


def test_a_message_that_is_too_long_ends_its_connection_only(publisher):
    with FoxgloveClient(publisher.url) as other:
        client = FoxgloveClient(publisher.url)
        client.send(b"\x01" + bytes(module.MAX_MESSAGE_BYTES))
        wait_for(lambda: len(publisher.clients) == 1)
        assert other.call("/reset", {})["success"]


def test_clients_that_die_leave_nothing(publisher):
    for _ in range(100):
        client = FoxgloveClient(publisher.url)
        client.subscribe("/odom")
        client.die()
    wait_for(lambda: not publisher.clients)
    wait_for(lambda: not publisher.wants("/odom"))


def test_too_many_clients_are_refused(publisher, monkeypatch):
    monkeypatch.setattr(module, "MAX_CLIENTS", 1)
    from websockets.exceptions import ConnectionClosed

    with FoxgloveClient(publisher.url), pytest.raises(ConnectionClosed, match="at most 1"):
        FoxgloveClient(publisher.url)


def test_the_queue_is_that_of_the_module():
    assert MAX_QUEUE < 1024  # the SDK's own: 400 MB of images of 360² px
