"""The READMEs: links and paths lead to files."""

import re
from pathlib import Path

import pytest

import omnisim

ROOT = Path(omnisim.__file__).parent.parent
READMES = sorted(
    path.relative_to(ROOT).as_posix()
    for folder in (".", "benchmarks", "omnisim", "scenes", "shaders")
    for path in (ROOT / folder).glob("**/README.md" if folder != "." else "README.md")
)
LINK = re.compile(r"\]\(([^)#\s]+)(#[^)\s]+)?\)")
CODE_PATH = re.compile(r"`((?:[\w.-]+/)+[\w.-]*)`")
ROOTS = (ROOT, ROOT / "omnisim")  # of paths in the texts


def _slug(heading):
    """Anchor of a heading on GitHub."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


@pytest.mark.parametrize("name", READMES)
def test_links_lead_to_files_and_headings(name):
    text = (ROOT / name).read_text(encoding="utf-8")
    for target, anchor in LINK.findall(text):
        if target.startswith("http"):
            continue
        path = (ROOT / name).parent / target
        assert path.exists(), f"{name}: {target}"
        if anchor:
            headings = re.findall(r"^#+ (.+)$", path.read_text(encoding="utf-8"), re.MULTILINE)
            assert anchor[1:] in map(_slug, headings), f"{name}: {target}{anchor}"


@pytest.mark.parametrize("name", READMES)
def test_paths_exist(name):
    text = (ROOT / name).read_text(encoding="utf-8")
    for path in CODE_PATH.findall(text):
        folder = path.split("/")[0]
        if folder == "out":  # what make writes
            continue
        for root in ROOTS:
            if (root / folder).is_dir() and not (ROOT / name).parent.joinpath(path).exists():
                assert any((root / path).exists() for root in ROOTS), f"{name}: {path}"
