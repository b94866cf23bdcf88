"""The page beside the plain protocol: its files, who may open them, and what it asks."""

import http.client
import json
import re
from urllib.parse import urlsplit

import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from omnisim import serve
from omnisim.apps.live.live import PAGE_FILES as LIVE_FILES
from omnisim.serve import PlainPublisher
from omnisim.serve.page_files import HEADERS
from omnisim.serve.protocols.plain_publisher import PAGE_FILES
from omnisim.serve.publisher import Client
from tests.serve import fake_robot


@pytest.fixture
def controls():
    return fake_robot.FakeControls()


@pytest.fixture
def publisher(controls):
    found = PlainPublisher(port=0)
    found.open(fake_robot.topics(), controls)
    yield found
    found.close()


def _get(publisher, path="/", **headers):
    connection = http.client.HTTPConnection("localhost", urlsplit(publisher.url).port, timeout=60)
    connection.request("GET", path, headers=headers)
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    return answer, body


def _socket(publisher, query="", **options):
    port = urlsplit(publisher.url).port
    return connect(f"ws://localhost:{port}/{query}", proxy=None, **options)


def _read(socket):
    data = socket.recv(60.0)
    return json.loads(data[4 : 4 + int.from_bytes(data[:4], "little")])


def test_the_port_serves_a_page_with_the_headers_of_live(publisher):
    answer, body = _get(publisher)
    assert (answer.status, answer.headers["Content-Type"]) == (200, "text/html; charset=utf-8")
    assert {name: answer.headers[name] for name in HEADERS} == HEADERS
    assert b"http://" not in body
    assert b"https://" not in body
    for path in ("/nothing", "/../access.py", "/%2e%2e/access.py", "//x", "//["):
        answer, body = _get(publisher, path)
        assert (answer.status, body) == (404, b"omnisim serve: no such file\n")


@pytest.mark.parametrize("files", [PAGE_FILES, LIVE_FILES], ids=["robot", "live"])
def test_all_files_that_a_page_names_are_there(files):
    named = set()
    for name, content in files.contents.items():
        if name.endswith((".html", ".js", ".css")):
            pattern = r'(?:from "\./|(?:src|href)="|url\()([\w.]+)'
            named |= set(re.findall(pattern, content.decode()))
    assert {"main.js", "stream.js", "drive.js", "style.css", "icon.svg"} <= named
    assert named <= set(files.contents)


def test_a_name_that_is_not_this_machine_is_refused(publisher):
    assert _get(publisher, Host="evil.example")[0].status == 403
    assert _get(publisher, Host="localhost:1234")[0].status == 200  # behind ssh -L
    with (
        pytest.raises(InvalidStatus, match="403"),
        _socket(publisher, origin="http://evil.example"),
    ):
        pass
    with _socket(publisher, origin=publisher.url.rstrip("/")) as socket:
        assert _read(socket)["op"] == "hello"


def test_elsewhere_the_page_brings_the_token_of_its_address():
    server = PlainPublisher("0.0.0.0", port=0)
    server.open(fake_robot.topics(), fake_robot.FakeControls())
    query = urlsplit(server.url).query
    assert re.fullmatch(r"token=[\w-]{22}", query)
    assert _get(server, f"/?{query}", Host="robot.example")[0].status == 200
    for given in ("", "?token=", f"?{query[:-1]}é"):
        with pytest.raises(InvalidStatus, match="401"), _socket(server, given):
            pass
    with _socket(server, f"?{query}", origin="http://robot.example") as socket:
        assert _read(socket)["op"] == "hello"
    server.close()


def test_the_state_lists_the_clients_of_all_protocols(publisher, controls):
    other = Client("foxglove", "127.0.0.1:4321", ("/odom",), 12)
    controls.now_s = 1.25
    with _socket(publisher) as socket:
        own = _read(socket)["client"]
        controls.clients = [other, *publisher.clients]
        for _ in range(100):  # a flood has few answers
            socket.send('{"op": "state"}')
        socket.send('{"op": "pause", "is_paused": false, "id": 1}')
        answers = [_read(socket)]
        while answers[-1]["op"] != "done":
            answers.append(_read(socket))
        state = answers[0] if len(answers) > 1 else _read(socket)
    assert len(answers) < 20
    assert (state["op"], state["now_s"], state["is_paused"]) == ("state", 1.25, False)
    assert state["clients"] == [
        {"protocol": "foxglove", "name": "127.0.0.1:4321", "topics": ["/odom"], "dropped": 12},
        {"protocol": "plain", "name": own, "topics": [], "dropped": 0},
    ]


def test_programs_connect_to_the_address_of_the_page(publisher):
    with serve.connect(publisher.url) as robot:
        assert robot.about["robots"] == ["robot"]
