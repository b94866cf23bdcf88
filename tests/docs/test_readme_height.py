"""README fits on few screens: five of 1000 px at a width of 940 px, as GitHub renders Markdown."""

import re
from pathlib import Path

import pytest

from tests.apps.live.test_page import browser  # noqa: F401 - a fixture
from tests.docs.pages import ROOT, text_of

WIDTH_PX, MAX_HEIGHT_PX = 940, 5000
FIRST_SCREEN_PX = 1000
STYLE = Path(__file__).with_name("github.css")


def test_readme_has_few_lines_and_images():
    """Without a browser: what its height depends on."""
    text = text_of("README.md")
    assert len(text.splitlines()) <= 120
    assert len(re.findall("<img ", text)) <= 4
    heights = [int(height) for height in re.findall(r'<img [^>]*(?:height|width)="(\d+)"', text)]
    assert len(heights) == len(re.findall("<img ", text))  # each at its shown size
    assert max(heights) <= 480  # half of a page
    assert text.index("make demo") < text.index("## Accuracy") < text.index("## Use it")


@pytest.mark.slow
def test_readme_is_five_screens_high(browser, tmp_path):  # noqa: F811
    from markdown_it import MarkdownIt

    body = MarkdownIt("commonmark", {"html": True}).enable("table").render(text_of("README.md"))
    page = browser.new_page(viewport={"width": WIDTH_PX, "height": FIRST_SCREEN_PX})
    (tmp_path / "a.html").write_text(
        f'<base href="{ROOT.as_uri()}/"><style>{STYLE.read_text()}</style>{body}', encoding="utf-8"
    )
    page.goto((tmp_path / "a.html").as_uri())
    bottom = "one => document.querySelector(one).getBoundingClientRect().bottom"
    assert page.evaluate("document.documentElement.scrollHeight") <= MAX_HEIGHT_PX
    assert page.evaluate(bottom, "table") <= FIRST_SCREEN_PX  # accuracy, on the first screen
    assert page.evaluate("[...document.images].every(one => one.naturalWidth > 0)")
    page.close()
