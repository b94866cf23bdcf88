"""Clients of the plain protocol that read nothing, flood, die, lie, or may not connect.

Nothing ends, another client's messages all arrive, and each error is one line. Foxglove's and
Zenoh's servers have tests of their own. Rates under attack are in `python -m benchmarks serve`.
"""

import contextlib
import json
import logging
import random
import socket
import threading
import time
import warnings
from urllib.parse import urlsplit

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect as open_connection

from omnisim.core.errors import OutputError
from omnisim.serve import PlainPublisher, access, connect
from omnisim.serve.client import ServeConnectionError
from omnisim.serve.protocols import plain_publisher as module
from tests.serve import fake_robot

TOPIC = "/imu/data_raw"
REQUESTS = (
    {"op": "subscribe", "topics": [TOPIC, "/odom"], "id": 1},
    {"op": "command", "robot": "robot", "speed_mps": 0.5, "turn_rate_radps": -0.25},
    {"op": "step", "seconds": 0.1, "id": 2},
    {"op": "pause", "is_paused": True, "id": 3},
    {"op": "reset", "id": 4},
    {"op": "state"},
    {"op": "set_pose", "robot": "", "x_m": 1.0, "y_m": -2.0, "yaw_rad": 0.5, "id": 5},
)
STRANGE = (
    None, True, -1, 10**400, 1e999, float("nan"), "", "\ud800", "x" * 200, [], [[]], {},
    [None] * 50, {"op": {}},
)  # fmt: skip


@pytest.fixture
def controls():
    return fake_robot.FakeControls()


@pytest.fixture
def publisher(controls, caplog):
    """An open publisher; nothing may be logged, and no thread may fail."""
    server = PlainPublisher(port=0)
    server.open(fake_robot.topics(), controls)
    server.address = server.url.replace("http", "ws").rstrip("/")
    with warnings.catch_warnings():
        warnings.simplefilter("error", pytest.PytestUnhandledThreadExceptionWarning)
        yield server
        server.close()
    assert [record for record in caplog.records if record.levelno >= logging.WARNING] == []


def port_of(publisher):
    return urlsplit(publisher.url).port


def wait_for(condition, seconds=20.0):
    end_s = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end_s, "waited in vain"
        time.sleep(0.005)


@contextlib.contextmanager
def other(publisher, topic=TOPIC):
    """Another client: all that is published while it is there must arrive, in order."""
    message, numbers, end = fake_robot.messages()[topic], [], threading.Event()
    with connect(publisher.address, [topic]) as client:

        def publish():
            while not end.wait(0.002):
                numbers.append(len(numbers))
                publisher.publish(topic, len(numbers) - 1, message)

        publishing = threading.Thread(target=publish)
        publishing.start()
        try:
            yield client
        finally:
            end.set()
            publishing.join()
        received = [client.next(10.0).stamp_ns for _ in numbers]
        assert received == numbers
        assert client.dropped == 0


def raw(publisher, **options):
    return open_connection(publisher.address, max_size=None, proxy=None, legacy=True, **options)


def text_of(data):
    """JSON of a message of the server."""
    return json.loads(data[4 : 4 + int.from_bytes(data[:4], "little")])


def die(connection):
    """End a connection without a word."""
    linger = b"\x01\0\0\0\0\0\0\0"  # RST, and no FIN
    connection.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger)
    connection.socket.shutdown(socket.SHUT_RDWR)
    connection.socket.close()


def test_a_client_that_reads_nothing_drops_only_its_own_messages(publisher, monkeypatch):
    monkeypatch.setattr(module, "MAX_QUEUE_BYTES", 1 << 20)
    image = np.zeros((256, 1024, 3), np.uint8)  # 0.8 MB: one fits
    big = fake_robot.ros.image(0, "front", image)
    with raw(publisher, max_queue=1) as idle:
        idle.send(json.dumps({"op": "subscribe", "topics": ["*"]}))
        wait_for(lambda: publisher.wants("/front/image_raw"))
        with other(publisher):
            for number in range(60):
                publisher.publish("/front/image_raw", number, big)
                time.sleep(0.005)
            (reader,) = (each for each in publisher._readers if "*" in each.topics)
            wait_for(lambda: reader.dropped > 20)
            assert reader._bytes <= 2 << 20
        assert sum(client.dropped > 0 for client in publisher.clients) == 1
        die(idle)


def test_queues_are_bounded_in_number_and_in_lockstep_too(monkeypatch):
    class Deaf:
        remote_address = None

    data = b"x" * 1000
    for keeps_all, most in ((False, module.MAX_QUEUE), (True, 50)):
        monkeypatch.setattr(module, "MAX_KEPT_BYTES", 50_000)
        reader = module._Reader(Deaf(), keeps_all)
        for _ in range(module.MAX_QUEUE + 100):
            reader.put(data)
        assert (len(reader._queue), reader._bytes) == (most, 1000 * most)
        assert reader.dropped == module.MAX_QUEUE + 100 - most


def test_messages_that_a_client_does_not_read_are_counted_there(publisher, monkeypatch):
    from omnisim.serve import client as client_module

    with connect(publisher.address, [TOPIC]) as client:
        monkeypatch.setattr(client_module, "KEPT", 0)  # any more is one too many
        for number in range(3):
            client._messages.clear()
            publisher.publish(TOPIC, number, fake_robot.messages()[TOPIC])
            assert client.next(10.0) is not None
        assert client.dropped == 3


def test_floods_of_commands_wait_while_others_are_served(publisher, controls):
    command = json.dumps(REQUESTS[1])
    with raw(publisher) as flood, other(publisher) as client:
        sending = threading.Thread(target=lambda: [flood.send(command) for _ in range(1000)])
        sending.start()
        client.reset()  # is answered meanwhile
        client.set_pose(1.0, 2.0, 0.5)
        sending.join(20.0)
        assert not sending.is_alive()
        die(flood)
    assert ("set_pose", "", 1.0, 2.0, 0.5) in controls.calls


def test_clients_that_die_leave_nothing(publisher):
    with other(publisher):
        for number in range(100):
            client = raw(publisher)
            if number % 2:
                client.send(json.dumps(REQUESTS[0]))
            die(client)
        wait_for(lambda: len(publisher.clients) == 1)
    wait_for(lambda: not publisher.wants("/odom"))


def mutated(rng):
    """Message of a client with a fault, or without."""
    request = json.loads(json.dumps(rng.choice(REQUESTS)))
    for _ in range(rng.randrange(3)):
        key = rng.choice([*request, "other"])
        if rng.random() < 0.3:
            request.pop(key, None)
        else:
            request[key] = rng.choice(STRANGE)
    text = json.dumps(request)
    kind = rng.randrange(6)
    if kind == 0:
        return rng.randbytes(rng.randrange(100))
    if kind == 1:
        data = bytearray(text, "utf-8")
        for _ in range(rng.randrange(1, 4)):
            data[rng.randrange(len(data))] = rng.randrange(256)
        return bytes(data)
    if kind == 2:
        return text[: rng.randrange(len(text))]
    if kind == 3:
        return "[" * rng.randrange(3000)
    return text


@pytest.mark.parametrize(
    ("seed", "count"), [(1, 500), pytest.param(2, 10_000, marks=pytest.mark.slow)]
)
def test_mutated_messages_are_answered_with_one_line_or_done(publisher, monkeypatch, seed, count):
    """All from one client: its connection remains, and all errors are read."""
    monkeypatch.setattr(access, "MAX_BYTES_PER_S", 1 << 26)
    rng = random.Random(seed)
    with raw(publisher) as client, other(publisher):
        answers = []
        for begin in range(0, count, 250):
            for _ in range(begin, begin + 250):
                client.send(mutated(rng))
            client.send('{"op": "pause", "is_paused": true, "id": 77}')
            while (answer := text_of(client.recv(timeout=20.0))).get("id") != 77:
                answers.append(answer)
    errors = {answer["text"] for answer in answers if answer["op"] == "error"}
    assert len(errors) > 20
    assert all("\n" not in text and len(text) < 200 for text in errors)


def test_bytes_that_are_no_websocket_end_their_connection_only(publisher):
    rng = random.Random(3)
    with other(publisher):
        for number in range(40):
            with socket.create_connection(("localhost", port_of(publisher))) as plain:
                if number % 2:
                    plain.sendall(rng.randbytes(300))
                else:
                    plain.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\n" * (1 + number % 3))
        for _ in range(20):  # frames that are none
            client = raw(publisher)
            client.socket.sendall(rng.randbytes(200))
            with contextlib.suppress(OSError):
                client.socket.shutdown(socket.SHUT_RDWR)
            client.socket.close()


def test_a_message_that_is_too_large_ends_its_connection_only(publisher):
    with raw(publisher) as client, other(publisher):
        client.send("x" * (module.MAX_MESSAGE_BYTES + 1))
        client.recv(timeout=20.0)  # what every client gets first
        with pytest.raises(ConnectionClosed, match=r"^received 1009 [^\n]+$"):
            client.recv(timeout=20.0)


@pytest.mark.parametrize("origin", ["http://localhost:8080", "file://"])
def test_pages_of_this_machine_may_connect(publisher, origin):
    raw(publisher, origin=origin).close()


@pytest.mark.parametrize(
    ("host", "origin"),
    [
        ("localhost", "https://evil.example"),
        ("localhost", "null"),
        ("localhost", "http://["),
        ("evil.example", "http://evil.example"),
        ("evil.example", None),
    ],
)
def test_other_websites_and_host_names_may_not(publisher, host, origin):
    address = publisher.address.replace("localhost", host)
    with (
        socket.create_connection(("localhost", port_of(publisher))) as plain,
        pytest.raises(InvalidStatus, match="403") as refusal,
    ):
        open_connection(address, sock=plain, origin=origin, proxy=None)
    assert refusal.value.response.body.count(b"\n") == 1
    assert publisher.clients == []


def test_elsewhere_the_token_is_needed(controls):
    server = PlainPublisher("0.0.0.0", 0)
    server.open(fake_robot.topics(), controls)
    address, token = server.url.split("/?token=")
    try:
        with connect(f"{address}/?token={token}") as client:
            client.reset()
        for url in (address, f"{address}/?token=", f"{address}/?token={token[:-1]}é"):
            with pytest.raises(ServeConnectionError, match=r"^[^\n]+: .*401$"):
                connect(url)
    finally:
        server.close()


def test_too_many_clients_are_refused(publisher, monkeypatch):
    monkeypatch.setattr(module, "MAX_CLIENTS", 2)
    with (
        connect(publisher.address),
        connect(publisher.address),
        pytest.raises(ServeConnectionError, match="503"),
    ):
        connect(publisher.address)
    wait_for(lambda: not publisher.clients)
    connect(publisher.address).close()


def test_clients_that_come_at_once_are_as_many_as_may(controls, monkeypatch):
    """All pass the first check before any of them is counted."""
    server = PlainPublisher(port=0)
    monkeypatch.setattr(server, "_check", server._access.check)
    monkeypatch.setattr(module, "MAX_CLIENTS", 1)
    server.open(fake_robot.topics(), controls)
    with connect(server.url), pytest.raises(ServeConnectionError, match="at most 1 clients"):
        connect(server.url)
    server.close()


@pytest.mark.parametrize("host", ["192.0.2.1", "no such host", "a..b"])
def test_a_host_elsewhere_is_one_line(host):
    server = PlainPublisher(host, 0)
    with pytest.raises(OutputError, match=r"^--port 0: cannot listen on [^\n:]+: [^\n]+$"):
        server.open(fake_robot.topics(), fake_robot.FakeControls())
    server.close()


def test_a_port_in_use_is_one_line(publisher):
    port = port_of(publisher)
    with pytest.raises(OutputError, match=rf"^--port {port}: cannot listen on localhost: [^\n]+$"):
        PlainPublisher(port=port).open(fake_robot.topics(), fake_robot.FakeControls())


def test_closing_twice_and_publishing_after_it_do_nothing(publisher):
    with connect(publisher.address, [TOPIC]) as client:
        publisher.close()
        publisher.close()
        publisher.publish(TOPIC, 0, fake_robot.messages()[TOPIC])
        assert client.next(10.0) is None
        with pytest.raises(ServeConnectionError, match="closed the connection"):
            client.reset()
