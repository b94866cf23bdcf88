"""Text of the documentation's pages, and the numbers in it."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
README, HOW_TO, WHY = "README.md", "docs/how-to/", "docs/explanation/"
NUMBER = r"(−?[\d.]+)"


def text_of(page):
    return (ROOT / page).read_text(encoding="utf-8")


def words_of(page):
    """A page's text without line breaks."""
    return " ".join(text_of(page).split())


def numbers_of(page, pattern):
    """Numbers, as text, where a pattern has `#`."""
    match = re.search(pattern.replace("#", NUMBER), words_of(page))
    assert match, f"{page}: {pattern}: not there"
    return match.groups()


def half_unit(text):
    """Half a unit of a number's last digit."""
    return 0.5 * 10.0 ** -len(text.partition(".")[2])
