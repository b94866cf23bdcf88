"""The page of a served robot in a browser: it drives, shows images, and lists clients."""

import dataclasses
import json
import time
from contextlib import contextmanager

import pytest

from omnisim import serve
from omnisim.robots import load_robot
from omnisim.robots.vehicle import Vehicle
from tests.serve.browsers import chromium
from tests.serve.test_lockstep import served

IMAGE = "/omnicam/image_raw/compressed"
LAST_IMAGE = f"""
async () => [...new Uint8Array(await omnisim.state.images["{IMAGE}"].last.arrayBuffer())]
"""
# A gamepad whose left stick is pushed ahead, then let go.
GAMEPAD = """
window.stick = -1;
navigator.getGamepads = () => [{connected: true, axes: [0, window.stick, 0, 0], buttons: []}];
"""

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("needs_opengl")]


@pytest.fixture(scope="module")
def browser():
    with chromium() as found:
        yield found


@pytest.fixture(scope="module")
def address():
    loaded = Vehicle.from_robot(load_robot("p2at")).with_cameras(size_px=64, quality="fast")
    sensors = tuple(each for each in loaded.sensors if each.name in ("omnicam", "lms200"))
    with served(dataclasses.replace(loaded, sensors=sensors), clock="wall") as (address, _):
        yield address


@contextmanager
def opened(browser, address, script=None, **options):
    """A page of the server, that has seen no error and no outside request in the end."""
    context = browser.new_context(**{"viewport": {"width": 1400, "height": 900}, **options})
    page, faults = context.new_page(), []
    if script is not None:
        page.add_init_script(script)
    page.on("console", lambda line: faults.append(line.text) if line.type == "error" else None)
    page.on("pageerror", lambda error: faults.append(str(error)))
    own = (address, "blob:", "data:", address.replace("http", "ws"))
    page.on(
        "request", lambda asked: None if asked.url.startswith(own) else faults.append(asked.url)
    )
    page.goto(address)
    wait_until(page, f"omnisim.views.get('{IMAGE}')?.canvas.width === 64")
    wait_until(page, "omnisim.state.places.length > 0")
    yield page
    assert faults == []
    context.close()


def wait_until(page, script, timeout_s=120.0):
    deadline_s = time.monotonic() + timeout_s
    while not page.evaluate(script):
        assert time.monotonic() < deadline_s, f"never: {script}"
        page.wait_for_timeout(20)


def place(page):
    return page.evaluate("omnisim.state.places.at(-1)")


def test_keys_drive_the_robot_and_letting_go_stops_it(browser, address):
    with opened(browser, address) as page:
        before = place(page)
        page.keyboard.down("w")
        page.keyboard.down("ArrowLeft")
        ahead = f"Math.hypot(p.x - {before['x']}, p.y - {before['y']}) > 0.05"
        wait_until(page, f"(p => {ahead} && p.yaw > {before['yaw']} + 0.05)({_LAST})")
        page.keyboard.up("w")
        page.keyboard.up("ArrowLeft")
        wait_until(page, "document.getElementById('speed').textContent === '0.00 m/s'")
        wait_until(page, "document.getElementById('turn-rate').textContent === '0.00 rad/s'")
        assert page.inner_text("#place").startswith(f"x {place(page)['x']:.2f}")


_LAST = "omnisim.state.places.at(-1)"


def test_a_gamepad_drives_the_robot(browser, address):
    with opened(browser, address, GAMEPAD) as page:
        before = place(page)
        wait_until(page, f"Math.hypot({_LAST}.x - {before['x']}, {_LAST}.y - {before['y']}) > 0.05")
        page.evaluate("window.stick = 0")
        wait_until(page, "document.getElementById('speed').textContent === '0.00 m/s'")


def test_images_and_hits_are_those_of_the_topics(browser, address):
    with opened(browser, address) as page, serve.connect(address, topics=[IMAGE]) as robot:
        page.click("#pause")
        wait_until(page, "omnisim.state.isPaused")
        while robot.next(1.0) is not None:
            pass
        time_s = page.evaluate("omnisim.state.nowS")
        page.keyboard.press("n")
        page.keyboard.press("n")
        page.keyboard.press("n")
        message = robot.next(60.0)
        wait_until(page, f"omnisim.state.nowS > {time_s} + 0.29")
        shown = bytes(page.evaluate(LAST_IMAGE))
        while message is not None and shown != message.fields["data"].tobytes():
            message = robot.next(5.0)
        assert message is not None
        wait_until(page, "Boolean(omnisim.state.mapImage)")
        hits = page.evaluate("Object.values(omnisim.state.hits).flatMap((one) => one.points)")
        assert len(hits) > 100
        page.click("#pause")
        wait_until(page, "!omnisim.state.isPaused")


def test_reset_begins_again(browser, address):
    with opened(browser, address) as page:
        wait_until(page, "omnisim.state.nowS > 0.5")
        time_s = page.evaluate("omnisim.state.nowS")
        page.click("#reset")
        wait_until(page, f"omnisim.state.nowS < {time_s}")
        wait_until(page, f"Math.abs({_LAST}.x - 0.5) < 1e-6 && Math.abs({_LAST}.yaw - 0.3) < 1e-6")


def test_clients_are_listed_and_leave(browser, address):
    with opened(browser, address) as page:
        with serve.connect(address, topics=["/odom", "/tf"]) as other:
            name = other.about["client"]
            page.wait_for_selector(f"#clients td:has-text('{name}')")
            row = page.locator("#clients tr", has_text=name)
            assert row.inner_text().split() == [name, "plain", "2", "0"]
            assert page.locator("#clients .own").inner_text().startswith("this page")
        page.wait_for_selector(f"#clients td:has-text('{name}')", state="detached")


def test_a_stream_that_is_hidden_is_not_received(browser, address):
    with opened(browser, address) as page:
        page.click("#chips [data-topic='/lms200/scan']")
        wait_until(page, "omnisim.state.clients.length > 0")
        own = "omnisim.state.clients.find((one) => one.name === omnisim.state.hello.client)"
        wait_until(page, f"!{own}.topics.includes('/lms200/scan')")
        assert page.evaluate(f"{own}.topics.includes('{IMAGE}')")


@pytest.mark.parametrize("width", [390, 800, 1400])
def test_nothing_is_wider_than_the_window(browser, address, width):
    with opened(browser, address, viewport={"width": width, "height": 844}) as page:
        page.wait_for_timeout(300)
        assert page.evaluate("document.documentElement.scrollWidth") <= width


def test_an_error_is_shown_in_words(browser, address):
    with opened(browser, address) as page:
        page.evaluate("omnisim.send('step', {seconds: -1})")
        page.wait_for_selector("#toast:not([hidden])")
        assert "step: seconds = -1: expected" in page.inner_text("#toast")
        assert json.loads(page.evaluate("JSON.stringify(omnisim.state.hello.robots)")) == ["p2at"]
