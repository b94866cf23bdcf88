"""Pages that orient a reader: the objects' figure, quoted messages, glossary, links, README."""

import importlib
import re
import sys
from pathlib import Path

import omnisim
from omnisim.datasets.generate.shard import shard_stem

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *(page for page in DOCS.rglob("*.md") if "_build" not in page.parts)]
PACKAGE = Path(omnisim.__file__).parent

sys.path.append(str(DOCS / "_ext"))
from object_figure import FIGURE, NODES, object_figure  # noqa: E402


def test_the_figure_is_that_of_the_code():
    renew = "python docs/_ext/object_figure.py"
    assert FIGURE.read_text(encoding="utf-8") == object_figure(), renew
    for node in NODES:
        if node.module is None:
            assert node.name == f"{shard_stem(0)}.tar"
            continue
        name, _, attribute = node.name.partition(".")
        kind = getattr(importlib.import_module(node.module), name)
        assert not attribute or attribute in kind.__annotations__


def test_quoted_messages_are_those_of_the_program():
    """Each part of a message that has no number stands in the source."""
    source = " ".join(path.read_text(encoding="utf-8") for path in PACKAGE.rglob("*.py"))
    # strings that go on in the next line are one
    source = re.sub(r"\s+", " ", re.sub(r'"\s*f?"', "", source))
    text = " ".join((DOCS / "how-to" / "troubleshooting.md").read_text(encoding="utf-8").split())
    quoted = re.findall(r"\*\*Messages?\*\*: (.*?)(?= ```| \*\*Fix)", text)
    messages = [message for line in quoted for message in re.findall("`([^`]+)`", line)]
    assert len(messages) >= 6
    for message in messages:
        for part in re.split(r"…|\d[\d.]*(?: × \d+)?|'\w+'|: ", message):
            assert part.strip(" :;'") in source, f"{message}: {part}"


def test_every_word_of_the_glossary_has_a_page_and_its_place():
    text = (DOCS / "reference" / "glossary.md").read_text(encoding="utf-8")
    rows = [line.split("|")[1:4] for line in text.splitlines() if line.startswith("| ")][2:]
    words = [word.strip() for word, _, _ in rows]
    assert words == sorted(words)
    assert len(words) >= 40
    assert all("](" in more for _, _, more in rows)


def test_readme_is_short():
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 130


def test_every_page_is_reached_from_the_first():
    reached, left = set(), [DOCS / "index.md"]
    while left:
        page = left.pop()
        if page in reached:
            continue
        reached.add(page)
        links = re.findall(r"\]\(([^)#\s]+\.md)", page.read_text(encoding="utf-8"))
        left += [found for link in links if (found := (page.parent / link).resolve()) in PAGES]
    assert not {page for page in PAGES if DOCS in page.parents} - reached


def _anchors(page):
    """Anchors of a page's headings, as GitHub and MyST make them."""
    headings = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_links_and_images_lead_to_files_and_headings():
    """But for the images that the documentation's build makes, and pages of the web."""
    for page in PAGES:
        for target, anchor in re.findall(
            r"\]\(([^)#\s]*)(?:#([^)\s]+))?\)", page.read_text(encoding="utf-8")
        ):
            if target.startswith(("http", "figures/")):
                continue
            path = page.parent / target if target else page
            assert path.exists(), f"{page}: {target}"
            assert not anchor or anchor in _anchors(path), f"{page}: {target}#{anchor}"
