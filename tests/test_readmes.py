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
TOP_FOLDERS = {path.name for path in ROOT.iterdir() if path.is_dir()}


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
def test_paths_from_the_root_exist(name):
    text = (ROOT / name).read_text(encoding="utf-8")
    for path in CODE_PATH.findall(text):
        if path.split("/")[0] in TOP_FOLDERS & {
            "omnisim",
            "shaders",
            "scenes",
            "tests",
            "benchmarks",
        }:
            assert (ROOT / path).exists(), f"{name}: {path}"
