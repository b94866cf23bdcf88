"""Server without a browser: images are the renderer's, and no client can end it."""

import dataclasses
import http.client
import io
import json
import shlex
import socket
import threading
import zipfile
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from websockets.exceptions import InvalidStatus

from omnisim import OmniCamera, load_scene, open_sensor
from omnisim.apps.live import live as server
from omnisim.apps.live.camera_document import CameraDocument, preset_lists
from omnisim.apps.live.live import PAGE, new_token, page_bytes
from omnisim.apps.live.live_source import RunSource
from omnisim.core.errors import OutputError
from omnisim.core.files.image_files import read_image
from omnisim.ground_truth import CHANNELS
from omnisim.robots.vehicle import Vehicle
from omnisim.scene.model import DynamicObject
from omnisim.scene.motion.object_motion import Orbit
from tests.apps.live.pages import SIZE_PX, Client, live_settings, served
from tests.scenes import room, scene_of, square

MAX_PAGE_BYTES = 200_000

pytestmark = pytest.mark.usefixtures("needs_opengl")


@pytest.fixture(scope="module")
def page():
    with served() as page:
        yield page


def _get(page, path="/", **headers):
    connection = http.client.HTTPConnection("localhost", page.server.port, timeout=120)
    connection.request("GET", path, headers=headers)
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    return answer, body


def test_the_page_and_all_that_it_names_are_served(page):
    answer, body = _get(page)
    assert (answer.status, answer.headers["Content-Type"]) == (200, "text/html; charset=utf-8")
    for name in ("style.css", "main.js", "icon.svg", "lenses.jpg"):
        assert _get(page, f"/{name}")[0].status == 200
    assert b"http://" not in body
    assert b"https://" not in body


def test_every_lens_has_an_image_of_its_own():
    with Image.open(PAGE / "lenses.jpg") as strip:
        assert strip.height == strip.width * len(preset_lists()["lens"])


def test_the_page_weighs_little():
    assert page_bytes() <= MAX_PAGE_BYTES


def test_nothing_but_the_page_is_served(page):
    for path in ("/../server.py", "/nothing", "/%2e%2e/server.py", "//x", "/?a"):
        answer, body = _get(page, path)
        assert answer.status in (200, 404)
        assert b"websockets" not in body


def test_a_name_that_is_not_this_machine_is_refused(page):
    assert _get(page, Host="evil.example")[0].status == 403
    assert _get(page, Host="localhost:1234")[0].status == 200  # behind ssh -L 1234:localhost:8080


def test_another_page_cannot_open_the_stream(page):
    with pytest.raises(InvalidStatus, match="403"):
        Client(page, origin="http://evil.example")
    with Client(page, origin=f"http://localhost:{page.server.port}") as client:
        assert client.receive("hello")["scene"] == "rings"


def test_a_token_is_asked_for_where_others_listen(page, monkeypatch):
    monkeypatch.setattr(page.server, "_token", token := new_token())
    for given in ("", "?token=", "?token=wrong", "?token=é"):
        with pytest.raises(InvalidStatus, match="401"):
            Client(page, given)
    with Client(page, f"?token={token}") as client:
        assert client.receive("hello")["scene"] == "rings"
    assert token in page.server.url


def test_a_page_too_many_is_refused(page, monkeypatch):
    monkeypatch.setattr(server, "MAX_PAGES", 0)  # one that was closed may still be open there
    with pytest.raises(InvalidStatus, match="503"):
        Client(page)


def test_the_image_at_rest_is_that_of_the_command_that_is_shown(page, tmp_path, monkeypatch):
    from omnisim.apps.cli.app import app

    monkeypatch.chdir(tmp_path)
    with Client(page) as client:
        client.send("place", x=0.3, y=-0.2, z=1.1, yaw_deg=33.3, pitch_deg=2.5)
        frame = client.fine_frame()
        words = shlex.split(frame["command"])
        assert words[:2] == ["omnisim", "render"]
        app(words[1:], standalone_mode=False)
        assert (tmp_path / "image.png").read_bytes() == frame["data"]["camera"]


def test_a_robots_image_is_that_of_the_command_that_is_shown(tmp_path, monkeypatch):
    from omnisim.apps.cli.app import app

    monkeypatch.chdir(tmp_path)
    vehicle = Vehicle.load("p2at")
    document = CameraDocument.of_camera(vehicle.camera().sensor).with_value("size_px", SIZE_PX)
    settings = live_settings(
        vehicle=vehicle, document=document, scene_arguments=("rings", "--robot", "p2at")
    )
    with served(settings) as page, Client(page) as client:
        client.send("place", x=0.31, y=-0.17, z=0.0, yaw_deg=33.3)
        frames = [client.fine_frame()]
        client.send("set", path="sensor.mirror.k", value=8.0)
        frames.append(client.fine_frame())
    for frame in frames:
        file, _, command = frame["command"].rpartition("omnisim render")
        assert bool(file) == (frame is frames[1])
        if file:
            (tmp_path / "camera.toml").write_text(file.partition("\n")[2].rpartition("END")[0])
        app(["render", *shlex.split(command)], standalone_mode=False)
        assert (tmp_path / "image.png").read_bytes() == frame["data"]["camera"]
    bare = OmniCamera().resized(SIZE_PX)  # the body is in it
    with open_sensor(load_scene("rings"), bare) as renderer:
        base = renderer.camera.base_pose(frame["viewpoint"]["position_m"], yaw_deg=33.3)
        without_body = renderer.render(base).rgb
    assert (read_image(tmp_path / "image.png")[0] != without_body).any()


def test_a_saved_camera_renders_the_same_image(page, tmp_path):
    with Client(page) as client:
        client.send("set", path="sensor.mirror.k", value=7.5)
        client.send("preset", kind="degradation", name="webcam")
        frame = client.fine_frame()
        client.send("save", what="toml")
        path = tmp_path / "camera.toml"
        path.write_bytes(client.receive("saved")["data"]["camera.toml"])
        client.send("reset")
        camera = OmniCamera.from_file(path).resized(SIZE_PX)
        place = frame["place"]
        with open_sensor(load_scene("rings"), camera) as renderer:
            angles_deg = {key: place[key] for key in ("yaw_deg", "pitch_deg", "roll_deg")}
            base = camera.base_pose(place["position_m"], **angles_deg)
            renderer.render(base).save(tmp_path / "a.png")
        assert (tmp_path / "a.png").read_bytes() == frame["data"]["camera"]
        assert "cat > camera.toml" in frame["command"]


def test_any_page_searches_the_catalog(page):
    with Client(page) as driver, Client(page) as watcher:
        for client, words in ((watcher, "hero 11 wide"), (driver, "no such camera")):
            client.send("search", words=words)
            found = client.receive("found")
            assert found["words"] == words
            assert bool(found["cameras"]) == (client is watcher)


def test_a_saved_image_has_all_channels(page, tmp_path):
    with Client(page) as client:
        frame = client.fine_frame()
        client.send("save", what="image")
        archive = zipfile.ZipFile(io.BytesIO(client.receive("saved")["data"]["omnisim.zip"]))
        (tmp_path / "saved.png").write_bytes(archive.read("image.png"))
        (tmp_path / "shown.png").write_bytes(frame["data"]["camera"])
        saved, shown = (read_image(tmp_path / f"{name}.png")[0] for name in ("saved", "shown"))
        np.testing.assert_array_equal(saved, shown)
        names = archive.namelist()
        assert all(any(f".{channel}." in name for name in names) for channel in CHANNELS)


def test_views_channels_and_legends_come_with_the_image(page):
    names = ["panorama", "perspective", "birdseye", "map", "range", "semantic", "normals"]
    with Client(page) as client:
        client.send("views", names=names)
        frame = client.fine_frame()
        parts = {part["name"]: part for part in frame["parts"]}
        assert list(parts) == ["camera", *(name for name in names if name != "map")]
        assert all(part["size"] for part in parts.values())
        assert parts["range"]["legend"]["unit"] == "m"
        assert parts["semantic"]["legend"]["items"]
        assert len(frame["seen_m"]) > 10
        found = client.receive("map")
        assert found["low_m"][0] < frame["viewpoint"]["position_m"][0] < found["high_m"][0]
        client.send("views", names=[])


def test_triangles_are_counted_on_request(page):
    with Client(page) as client:
        change = client.fine_frame()["change"]
        client.send("statistics")
        counted = client.receive("statistics")
        state = page.session.state
        camera, place = state.document.camera(), state.place
        base = camera.base_pose(place.position_m, yaw_deg=place.yaw_deg, pitch_deg=place.pitch_deg)
        with open_sensor(load_scene("rings"), camera) as renderer:
            expected = renderer.statistics(base)
        assert counted["change"] == change
        assert [counted[name] for name in expected._fields] == list(expected)
        assert counted["submitted"] >= counted["seen"] > 0


def test_a_probe_is_the_ray_of_its_pixel(page):
    with Client(page) as client:
        frame = client.fine_frame()
        client.send("probe", view="camera", u=0.5, v=0.72)
        found = client.receive("probe")
        eye, point = frame["viewpoint"]["position_m"], found["point_m"]
        way = [b - a for a, b in zip(eye, point, strict=True)]
        assert sum(x * x for x in way) ** 0.5 == pytest.approx(found["range_m"], rel=1e-3)
        for axis, direction in zip(way, found["direction"], strict=True):
            assert axis == pytest.approx(direction * found["range_m"], abs=1e-3)
        assert set(found["marks"]) >= {"camera", "panorama"}
        u, v = found["marks"]["panorama"]
        client.send("probe", view="panorama", u=u, v=v)
        back = client.receive("probe")
        assert back["marks"]["camera"] == pytest.approx(found["marks"]["camera"])


def test_a_fault_is_told_and_the_camera_stays(page):
    with Client(page) as client:
        before = client.fine_frame()
        for path, value, words in (
            ("sensor.mirror.k", 1.0, "mirror.k: expected a number ≥ 2, got 1.0"),
            ("size_px", 100_000, "expected"),
            ("sensor.camera.width_px", 100_000, "expected"),
        ):
            client.send("set", path=path, value=value)
            client.send("ask")
            assert words in client.receive("error")["text"]
        assert client.fine_frame()["data"]["camera"] == before["data"]["camera"]


def test_objects_move_while_the_clock_runs():
    shape = scene_of([square(0.3, 1.2)])
    ball = DynamicObject("ball", shape, Orbit((0.5, 0.0, 0.0), 0.5, 4.0))
    moving = dataclasses.replace(scene_of([room()]), objects=(ball,))
    settings = dataclasses.replace(live_settings(), scene=moving)
    with served(settings) as page, Client(page) as client:
        assert client.receive("hello")["has_clock"]
        first = client.fine_frame()
        client.send("clock", running=True)
        times = [client.frame()["time_s"] for _ in range(3)]
        assert times == sorted(times)
        assert times[-1] > first["time_s"]
        client.send("clock", running=False, time_s=0.0)
        assert client.fine_frame()["data"]["camera"] == first["data"]["camera"]


def test_a_run_is_replayed(tmp_path, monkeypatch):
    from omnisim.apps.cli.app import app

    monkeypatch.chdir(tmp_path)
    Path("poses.tum").write_text("0 0 0 1 0 0 0 1\n1 0.1 0.2 1.1 0 0 0 1\n")
    record = "record rings --trajectory poses.tum --trajectory-frame body --size 32 --also range"
    app([*record.split(), "--quality", "fast", "-o", "run"], standalone_mode=False)
    with served(partial(RunSource, tmp_path / "run")) as page, Client(page) as client:
        hello = client.receive("hello")
        assert (hello["steps"], hello["is_editable"]) == (2, False)
        assert hello["driven_m"] == [[0.0, 0.0], [0.1, 0.2]]
        client.send("views", names=["range", "normals"])
        client.send("replay", step=1)
        frame = client.fine_frame()
        assert frame["data"]["camera"] == Path("run/camera/000001.png").read_bytes()
        assert frame["command"] == f"# {tmp_path}/run/camera/000001.png"
        assert [part["size"] > 0 for part in frame["parts"]] == [True, True, False]
        mounted_m = np.array([0.1, 0.2, 1.1]) + OmniCamera().base_from_optical[:3, 3]
        np.testing.assert_allclose(frame["viewpoint"]["position_m"], mounted_m, atol=1e-6)
        client.send("statistics")
        assert "triangles are not counted" in client.receive("error")["text"]
        client.send("save", what="image")
        archive = zipfile.ZipFile(io.BytesIO(client.receive("saved")["data"]["omnisim.zip"]))
        assert len(archive.namelist()) > 1
        assert archive.read("000001.png") == frame["data"]["camera"]


def test_rubbish_is_answered_in_words(page):
    with Client(page) as client:
        for rubbish in ("", "rubbish", b"\x00\x01", "[" * 10_000, '{"type": 7}'):
            client.socket.send(rubbish)
            assert "message: " in client.receive("error")["text"]
        assert client.fine_frame()["is_fine"]


def test_a_client_that_vanishes_leaves_the_others(page):
    with Client(page) as other:
        hello = other.receive("hello")
        raw = socket.create_connection(("localhost", page.server.port))
        raw.sendall(b"GET /stream HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\n")
        raw.close()
        gone = Client(page)
        gone.send("drive", ahead=1.0)
        gone.send("ask")
        gone.socket.socket.close()
        assert other.fine_frame()["is_fine"]
        assert hello["page"]


def test_one_drives_and_the_others_watch(page):
    with Client(page) as driver, Client(page) as watcher:
        assert driver.receive("roles")["drives"]
        assert not watcher.receive("roles")["drives"]
        driver.send("place", x=0.1, y=0.0, z=1.0, yaw_deg=10.0)
        shown = driver.fine_frame()
        seen = watcher.fine_frame()
        assert seen["data"]["camera"] == shown["data"]["camera"]
        watcher.send("place", x=5.0, y=0.0, z=1.0, yaw_deg=0.0)
        assert "another browser is in control" in watcher.receive("error")["text"]
        watcher.send("wheel")
        assert "in control right now" in watcher.receive("error")["text"]
        page.server._driven_s -= server.IDLE_S
        watcher.send("wheel")
        assert watcher.receive("roles")["drives"]
        watcher.send("place", x=0.2, y=0.0, z=1.0, yaw_deg=0.0)
        assert watcher.fine_frame()["place"]["position_m"][0] == 0.2


def test_another_page_may_drive_when_the_first_is_closed(page):
    driver, watcher = Client(page), Client(page)
    driver.receive("roles")
    assert not watcher.receive("roles")["drives"]
    driver.close()
    while not watcher.receive("roles")["drives"]:
        pass
    watcher.close()


def test_a_slow_watcher_holds_nobody_up(page):
    with Client(page) as driver, Client(page):  # which never asks
        for number in range(5):
            driver.send("place", x=0.01 * number, y=0.0, z=1.0, yaw_deg=0.0)
            assert driver.frame()["place"]["position_m"][0] == 0.01 * number


def test_a_port_that_is_taken_is_one_line(page):
    words = f"--port {page.server.port}: cannot listen on localhost"
    with pytest.raises(OutputError, match=words), served(port=page.server.port):
        pass


def test_closing_ends_the_threads_of_a_page():
    before = threading.active_count()
    with served() as page, Client(page) as client:
        client.fine_frame()
        assert threading.active_count() > before
    assert not page.engine._thread.is_alive()


def test_a_notebook_shows_the_page_as_a_frame():
    from omnisim import live

    with live("rings", size_px=64) as view:
        assert f'<iframe src="{view.url}"' in view._repr_html_()
        assert view.url.startswith("http://localhost:")
        json.dumps(repr(view))
