"""Page in a real browser: no outside request, no error, and images that are the renderer's."""

import importlib.util
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from contextlib import contextmanager

import pytest

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
FINE = "body[data-fine='true']"

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("needs_opengl")]


@pytest.fixture(scope="module")
def browser():
    executable = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    if executable is None:
        pytest.skip(f"there is no browser: none of {', '.join(BROWSERS)}")
    if importlib.util.find_spec("playwright") is None:
        pytest.skip("playwright, which drives the browser, is not installed")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path=executable, args=["--no-sandbox"])
        yield found
        found.close()


@pytest.fixture(scope="module")
def live(tmp_path_factory):
    """Address of `omnisim live` in a process of its own."""
    with started(tmp_path_factory.mktemp("live"), "rings", "--size", "128") as url:
        yield url


@contextmanager
def started(folder, *words):
    """Address of a server that ends at once, and without an error, by Ctrl-C."""
    with (
        (folder / "errors.txt").open("w") as errors,
        subprocess.Popen(
            [sys.executable, "-m", "omnisim", "live", *words, "--port", "0"],
            stdout=subprocess.PIPE, stderr=errors, text=True, cwd=folder,
            env=os.environ | {"COLUMNS": "200"},
        ) as process,
    ):  # fmt: skip
        line = process.stdout.readline()
        assert line.startswith("Open http://localhost:"), (folder / "errors.txt").read_text()
        try:
            yield line.split()[1]
        finally:
            process.send_signal(signal.SIGINT)
            status = process.wait(120)
    assert (status, (folder / "errors.txt").read_text()) == (0, "")


@pytest.fixture
def page(browser, live):
    """A new page of the server, that has seen no error and no outside request in the end."""
    context = browser.new_context(
        viewport={"width": 1440, "height": 900}, permissions=["clipboard-read", "clipboard-write"]
    )
    page, faults = context.new_page(), []
    page.on("console", lambda line: faults.append(line.text) if line.type == "error" else None)
    page.on("pageerror", lambda error: faults.append(str(error)))
    own = (live, "blob:", "data:", live.replace("http", "ws"))
    page.on(
        "request", lambda asked: None if asked.url.startswith(own) else faults.append(asked.url)
    )
    page.goto(live)
    page.wait_for_selector(FINE)
    wait_until(lambda: page.evaluate("omnisim.state.drives"), "it drives")
    rest(page, -1)
    yield page
    assert faults == []
    context.close()


def wait_until(is_true, what, timeout_s=120.0):
    deadline_s = time.monotonic() + timeout_s
    while not is_true():
        assert time.monotonic() < deadline_s, f"never: {what}"
        time.sleep(0.02)


def change(page):
    return int(page.get_attribute("body", "data-change"))


def rest(page, after, still_s=0.8):
    """Wait for a fine image of a state after another, which stays for a while."""
    deadline_s, since_s, last = time.monotonic() + 120.0, 0.0, None
    while last is None or time.monotonic() - since_s < still_s:
        size_bytes = page.evaluate("omnisim.views.get('camera').blob.size")
        now = (change(page), page.get_attribute("body", "data-fine"), size_bytes)
        if now[0] <= after or now[1] != "true":
            now = None
        if now is None or now != last:
            last, since_s = now, time.monotonic()
        assert time.monotonic() < deadline_s, f"never: a fine image after {after}"
        time.sleep(0.1)


@contextmanager
def settled(page):
    """Wait, after what the block does, for the fine image of another state."""
    before = change(page)
    yield
    rest(page, before)


def press(page, keys, ms):
    """Hold keys down together."""
    for key in keys:
        page.keyboard.down(key)
    page.wait_for_timeout(ms)
    for key in keys:
        page.keyboard.up(key)


def shown_png(page):
    """Bytes of the camera's fine image that is shown; a coarse one before it is a JPEG."""
    script = "async () => [...new Uint8Array(await omnisim.views.get('camera').blob.arrayBuffer())]"
    while (shown := bytes(page.evaluate(script)))[1:4] != b"PNG":
        page.wait_for_timeout(50)
    return shown


def rendered_png(page, folder):
    """Bytes of the image by the command line that the page copies."""
    page.click("#copy-command")
    command = page.evaluate("navigator.clipboard.readText()")
    own = f"{shlex.quote(sys.executable)} -m omnisim render"
    command = command.replace("omnisim render", own)
    subprocess.run(["bash", "-ec", command], cwd=folder, check=True, capture_output=True)
    return (folder / "image.png").read_bytes()


def test_keys_move_the_camera_and_the_image_is_the_renderers(page, tmp_path):
    place = page.inner_text("#place")
    with settled(page):
        press(page, ("w", "ArrowLeft"), 400)
    assert page.inner_text("#place") != place
    assert shown_png(page) == rendered_png(page, tmp_path)


def test_a_slider_changes_the_mirror_and_undo_takes_it_back(page, tmp_path):
    first = shown_png(page)
    with settled(page):
        page.locator("[data-path='sensor.mirror.k'] input[type=range]").focus()
        for _ in range(5):
            page.keyboard.press("PageUp")
    changed = shown_png(page)
    assert changed != first
    assert changed == rendered_png(page, tmp_path)
    k = float(page.input_value("[data-path='sensor.mirror.k'] input[type=number]"))
    assert k > 11.546
    with page.expect_download() as saved:
        page.click("#save-toml")
    assert "k = " in saved.value.path().read_text()
    with settled(page):
        page.keyboard.press("Control+z")
    assert shown_png(page) == first


def test_a_lens_is_one_click_away_and_the_menu_switches_and_shows_its_model(page, tmp_path):
    first = shown_png(page)
    page.click("summary:has-text('Mirrors and lenses')")
    with settled(page):
        page.click(".lenses button[data-name=eucm]")
    assert shown_png(page) == rendered_png(page, tmp_path)
    assert page.locator("[data-path='sensor.lens.alpha']").is_visible()
    menu = page.locator("[data-path='sensor.lens.model'] select")
    assert menu.input_value() == "eucm"
    assert menu.locator("option[value='']").count() == 0
    with settled(page):
        menu.select_option("rational_polynomial")
    assert page.locator("#fault").is_hidden()
    assert menu.input_value() == page.evaluate("omnisim.state.camera.model")
    pressed = page.locator(".lenses button[aria-pressed=true]")
    assert pressed.get_attribute("data-name") == "rational_polynomial"
    with settled(page):
        page.click("#reset")
    assert shown_png(page) == first


def test_a_camera_of_the_catalog_is_found_and_chosen(page, tmp_path):
    first = shown_png(page)
    page.fill("#search", "hero 11 wide")
    options = page.locator("#found li")
    options.first.wait_for()
    titles = options.locator("span").all_inner_texts()
    assert titles[0] == "GoPro HERO11 Black Wide"
    assert all("HERO11" in title and "Wide" in title for title in titles)
    assert page.get_attribute("#search", "aria-expanded") == "true"
    chosen = page.locator("#found li[aria-selected=true] small")
    while "3840 × 2160 px" not in chosen.inner_text():
        page.press("#search", "ArrowDown")  # drives nothing, since the box has the focus
    with settled(page):
        page.press("#search", "Enter")
    assert page.evaluate("omnisim.state.camera.model") == "kannala_brandt"
    focal_px = page.locator("[data-path='sensor.lens.focal_lengths_px'] input").first
    assert float(focal_px.input_value()) == pytest.approx(1796.32082)
    assert shown_png(page) == rendered_png(page, tmp_path)
    page.fill("#search", "hero")
    page.wait_for_selector("#more:has-text(' more: add words')")
    page.fill("#search", "no such camera")
    page.wait_for_selector("#more:has-text('No camera has all of these words.')")
    assert options.count() == 0
    page.press("#search", "Escape")
    assert page.input_value("#search") == ""
    assert page.locator("#more").is_hidden()
    with settled(page):
        page.click("#reset")
    assert shown_png(page) == first


def test_each_lens_has_an_image_of_its_own(page):
    rows = page.eval_on_selector_all(
        ".lenses i", "icons => icons.map((one) => one.style.backgroundPosition)"
    )
    assert len(set(rows)) == len(rows) == page.evaluate("omnisim.state.about.presets.lens.length")


def test_a_button_leads_back_to_the_start_and_a_key_switches_walls(page):
    with settled(page):
        page.click("#start")  # tests before this one have moved the camera of the same server
    place, first = page.inner_text("#place"), shown_png(page)
    with settled(page):
        page.keyboard.press("c")
        wait_until(lambda: page.get_attribute("#walls", "aria-pressed") == "false", "no walls")
        press(page, "w", 300)
    wait_until(lambda: page.inner_text("#place") != place, "another place")
    page.click("#start")
    page.click("#walls")
    wait_until(lambda: page.inner_text("#place") == place, "the start")
    wait_until(lambda: shown_png(page) == first, "the first image")
    assert page.get_attribute("#walls", "aria-pressed") == "true"


@pytest.mark.parametrize(("width", "height", "share"), [(1400, 900, 0.9), (900, 700, 0.8)])
def test_views_fill_the_window_without_scrolling(page, width, height, share):
    page.set_viewport_size({"width": width, "height": height})
    page.wait_for_timeout(500)
    stage = page.locator("#stage").bounding_box()
    bottoms = [
        box["y"] + box["height"]
        for view in page.locator(".view").all()
        for box in [view.bounding_box()]
    ]
    assert max(bottoms) <= stage["y"] + stage["height"]
    assert max(bottoms) - stage["y"] >= share * stage["height"]


def test_a_fault_is_shown_and_the_image_stays(page):
    first = shown_png(page)
    with settled(page):
        page.fill("[data-path='sensor.mirror.k'] input[type=number]", "1")
        page.keyboard.press("Enter")
        page.wait_for_selector("#fault:not([hidden])")
        assert page.inner_text("#fault") == "mirror.k: expected a number ≥ 2, got 1"
    assert shown_png(page) == first


def test_views_are_switched_and_a_point_is_marked_in_all(page):
    for name in ("perspective", "birdseye", "semantic"):
        if page.get_attribute(f"#chips [data-view={name}]", "aria-pressed") == "false":
            page.click(f"#chips [data-view={name}]")
    page.wait_for_selector(".view[data-view=semantic] .legend span")
    canvas = page.locator(".view[data-view=camera] canvas")
    box = canvas.bounding_box()
    canvas.hover(position={"x": 0.5 * box["width"], "y": 0.7 * box["height"]})
    page.wait_for_selector(".view[data-view=panorama] .mark:not([hidden])", state="attached")
    wait_until(lambda: " m · " in page.inner_text("#probe"), "the range")
    for name in ("camera", "semantic", "birdseye"):
        assert page.is_visible(f".view[data-view={name}] .mark"), name


def test_triangles_are_counted_and_the_map_is_announced_until_it_is_built(page):
    page.click("#rate")
    page.click("#times button")
    page.wait_for_selector("#times :text('triangles seen')")
    assert re.search(r"triangles submitted\s+[1-9][\d,]*", page.inner_text("#times"))
    page.click("#rate")
    page.evaluate("omnisim.state.mapMessage = null")
    page.click("#chips [data-view=map]")
    page.click("#chips [data-view=map]")
    assert page.inner_text(".view[data-view=map] .reason") == "building the map …"
    page.reload()
    page.wait_for_selector(".view[data-view=map] .reason", state="hidden")


def test_a_second_page_watches(page, browser, live):
    other = browser.new_page()
    other.goto(live)
    other.wait_for_selector(FINE)
    assert other.inner_text("#roles") == "watching"
    with settled(page):
        press(page, "s", 200)
    wait_until(lambda: other.inner_text("#place") == page.inner_text("#place"), "the same place")
    wait_until(lambda: shown_png(other) == shown_png(page), "the same image")
    other.close()


def test_a_click_on_the_map_goes_there(page):
    page.wait_for_selector(".view[data-view=map] canvas")
    wait_until(lambda: page.evaluate("Boolean(omnisim.state.mapMessage)"), "the map")
    place = page.inner_text("#place")
    box = page.locator(".view[data-view=map] canvas").bounding_box()
    with settled(page):
        page.mouse.click(box["x"] + 0.4 * box["width"], box["y"] + 0.6 * box["height"])
    assert page.inner_text("#place") != place


def test_all_is_reached_by_the_keyboard(page):
    reached = set()
    for _ in range(80):
        page.keyboard.press("Tab")
        reached.add(page.evaluate(
            "document.activeElement.id || document.activeElement.getAttribute('aria-label')"
            " || document.activeElement.textContent.slice(0, 30)"
        ))  # fmt: skip
    assert {"theme", "help", "save-toml", "copy-command", "save-image"} <= reached
    page.keyboard.press("?")
    assert page.is_visible("#help-dialog")
    page.keyboard.press("Escape")


def test_nothing_is_wider_than_the_window(page):
    for width in (390, 800, 1440):
        page.set_viewport_size({"width": width, "height": 844})
        page.wait_for_timeout(200)
        assert page.evaluate("document.documentElement.scrollWidth") <= width


@pytest.mark.long
def test_a_robot_is_driven_by_keys(browser, tmp_path):
    (tmp_path / "my.toml").write_text("[mirror]\nk = 5.0\n")
    words = ("soccer", "--robot", "p2at", "--sensor", "my.toml", "--size", "96")
    with started(tmp_path, *words) as url:
        page = browser.new_page()
        page.goto(url)
        page.wait_for_selector(FINE)
        place = page.inner_text("#place")
        with settled(page):
            press(page, ("ArrowUp",), 1500)
        assert page.inner_text("#place") != place
        assert page.evaluate("omnisim.state.about.outline_m") == [0.626, 0.505]
        assert page.input_value("[data-path='sensor.mirror.k'] input[type=number]") == "5"
        page.close()
