"""Pages that orient a reader: quoted messages, glossary, links, README."""

import re
from pathlib import Path

import omnisim

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *(page for page in DOCS.rglob("*.md") if "_build" not in page.parts)]
PACKAGE = Path(omnisim.__file__).parent


def test_quoted_messages_are_those_of_the_program():
    """Each part of a message that has no number stands in the source."""
    files = (*PACKAGE.rglob("*.py"), *PACKAGE.rglob("features.json"))
    source = " ".join(path.read_text(encoding="utf-8") for path in files)
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


def test_no_page_shows_directives_on_github():
    """They stand in comments, and the text in their place has a link or says it itself."""
    for page in PAGES:
        text = re.sub(r"<!--.*?-->", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
        assert "```{" not in text, page
        assert not re.search(r"\{\w+\}`", text), page
        assert re.search(r"^# ", text, re.MULTILINE), page


def _anchors(page):
    """Anchors of a page's headings, as GitHub and MyST make them."""
    headings = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_links_and_images_lead_to_files_and_headings():
    """But for pages of the web."""
    for page in PAGES:
        for target, anchor in re.findall(
            r"\]\(([^)#\s]*)(?:#([^)\s]+))?\)", page.read_text(encoding="utf-8")
        ):
            if target.startswith("http"):
                continue
            path = page.parent / target if target else page
            assert path.exists(), f"{page}: {target}"
            assert not anchor or anchor in _anchors(path), f"{page}: {target}#{anchor}"


def test_paths_and_targets_in_the_text_exist():
    folders = "benchmarks|docs|examples|omnisim|scenes|shaders|tests|[.]ci"
    targets = set(re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE))
    for page in PAGES:
        text = page.read_text(encoding="utf-8").replace("/NAME.", "/sphere.")
        paths = re.findall(rf"[` ]((?:{folders})/[\w./-]*\w)(?=[` :])", text)
        paths += [
            f"{name.replace('.', '/')}.py" for name in re.findall(r"-m\s+(benchmarks\.\w+)", text)
        ]
        missing = [path for path in paths if not (ROOT / path).exists()]
        missing += set(re.findall(r"`make ([\w-]+)`", text)) - targets
        assert not missing, page


# Section of CONTRIBUTING.md on how a frame is drawn.
FRAME = (
    (ROOT / "CONTRIBUTING.md")
    .read_text(encoding="utf-8")
    .partition("## How a frame is drawn\n")[2]
    .partition("\n## ")[0]
)
OPENGL = PACKAGE / "rendering" / "opengl"


def test_the_section_on_a_frame_quotes_the_methods_lines_and_names_files_that_exist():
    code = (OPENGL / "camera_frame.py").read_text(encoding="utf-8")
    lines = {line.strip() for line in code.splitlines()}
    blocks = re.findall(r"```python\n(.*?)```", FRAME, flags=re.DOTALL)
    quoted = [line.strip() for block in blocks for line in block.splitlines()]
    assert len(quoted) > 10
    assert not set(quoted) - lines
    named = re.findall(r"`([a-z_/]+(?:\.py|/))`", FRAME)
    assert len(named) > 15
    places = (ROOT, PACKAGE, OPENGL)
    assert not [name for name in named if not any((place / name).exists() for place in places)]
