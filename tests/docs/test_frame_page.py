"""The page on how a frame is drawn shows the code's own lines, and names files that exist."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
SECTION = PAGE.partition("## How a frame is drawn\n")[2].partition("\n## ")[0]
OPENGL = ROOT / "omnisim" / "rendering" / "opengl"


def test_quotes_the_methods_lines():
    code = (OPENGL / "camera_frame.py").read_text(encoding="utf-8")
    lines = {line.strip() for line in code.splitlines()}
    blocks = re.findall(r"```python\n(.*?)```", SECTION, flags=re.DOTALL)
    quoted = [line.strip() for block in blocks for line in block.splitlines()]
    assert len(quoted) > 10
    assert not set(quoted) - lines


def test_names_files_that_exist():
    named = re.findall(r"`([a-z_/]+(?:\.py|/))`", SECTION)
    places = (ROOT, ROOT / "omnisim", OPENGL)
    assert len(named) > 15
    assert not [one for one in named if not any((place / one).exists() for place in places)]
