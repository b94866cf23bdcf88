"""Screenshot and film of the live page, from a browser: `make live-image`.

They go to docs/how-to: live.jpg and live.mp4.
"""

from __future__ import annotations

import io
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from PIL import Image
from playwright.sync_api import Page, sync_playwright

ROOT = Path(__file__).resolve().parents[1]
TARGET = ROOT / "docs" / "how-to"
SIZE = {"width": 1280, "height": 720}
RATE_HZ = 8.0
FINE = "body[data-fine='true']"


def main() -> None:
    """Serve the page, and drive it."""
    sys.path.insert(0, str(ROOT))
    from omnisim.plots.video_file import write_video

    command = [sys.executable, "-m", "omnisim", "live", "soccer", "--port", "0"]
    with (
        subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as process,
        sync_playwright() as playwright,
    ):
        assert process.stdout is not None
        url = process.stdout.readline().split()[1]
        chromium = shutil.which("chromium")
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        page = browser.new_page(viewport=SIZE)
        page.goto(url)
        page.wait_for_selector(FINE)
        page.wait_for_timeout(3000)
        count = write_video(TARGET / "live.mp4", film(page), RATE_HZ)
        page.wait_for_timeout(2000)
        page.wait_for_selector(FINE)
        data = io.BytesIO(page.screenshot())
        Image.open(data).convert("RGB").save(TARGET / "live.jpg", quality=86, optimize=True)
        browser.close()
        process.terminate()
    print(f"live.mp4: {count} images")


def film(page: Page) -> Iterator[np.ndarray]:
    """Drive in an arc, point at the image, make the mirror flatter, look through a fisheye."""
    page.keyboard.down("w")
    page.keyboard.down("ArrowLeft")
    yield from images(page, 12)
    page.keyboard.up("ArrowLeft")
    yield from images(page, 10)
    page.keyboard.up("w")
    canvas = page.locator(".view[data-view=camera] canvas")
    box = canvas.bounding_box()
    assert box is not None
    for share in np.linspace(0.25, 0.75, 10):
        canvas.hover(position={"x": share * box["width"], "y": 0.3 * box["height"]})
        page.wait_for_timeout(150)
        yield from images(page, 1)
    slider = page.locator("[data-path='sensor.mirror.k'] input[type=range]")
    slider.focus()
    for key in ("PageDown",) * 4 + ("PageUp",) * 6 + ("PageDown",) * 2:
        page.keyboard.press(key)
        page.wait_for_timeout(300)
        yield from images(page, 2)
    page.click("summary:has-text('Mirrors and lenses')")
    page.click(".lenses button[data-name=equidistant]")
    page.wait_for_timeout(1500)
    yield from images(page, 8)
    page.click("#reset")
    page.wait_for_timeout(1500)
    yield from images(page, 8)


def images(page: Page, count: int) -> Iterator[np.ndarray]:
    """Images of the page as it is now."""
    for _ in range(count):
        yield np.asarray(Image.open(io.BytesIO(page.screenshot())).convert("RGB"))


if __name__ == "__main__":
    main()
