"""Reference pages from the code: whole pages, and tables between two comments of a page.

The default sensor file is one of them.

`make docs` renews them; `python docs/_ext/reference_pages.py` does without Sphinx.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from command_line import command_line_page
from default_sensor_file import default_sensor_file
from error_table import errors_page
from export_formats import export_formats
from file_keys import key_pages
from omnisim.rendering.camera.sensor_file import DEFAULT_SENSOR_FILE
from python_names import python_names
from scene_formats import scene_format_pages

REFERENCE = Path(__file__).resolve().parents[1] / "reference"
_BLOCK = re.compile(
    r"(?<=<!-- from the code: )([\w-]+)( -->\n).*?(?=<!-- end of \1 -->)", re.DOTALL
)


def reference_pages() -> Iterator[tuple[Path, str]]:
    """Pages as the code has them; each that is not written by hand alone.

    Raises:
        LookupError: a page has a block that the code does not know, or a block has no page.
    """
    whole = {"command-line": command_line_page(), "errors": errors_page()}
    for name, text in whole.items():
        yield REFERENCE / f"{name}.md", text
    yield DEFAULT_SENSOR_FILE, default_sensor_file()
    blocks = {
        "export-formats": export_formats(),
        "python-names": python_names(),
        **key_pages(),
        **scene_format_pages(),
    }
    placed = set()
    for path in sorted(REFERENCE.glob("*.md")):
        text = path.read_text(encoding="utf-8")
        names = {match[1] for match in _BLOCK.finditer(text)}
        placed |= names
        if names and path.stem not in whole:
            yield path, _BLOCK.sub(lambda match: f"{match[1]}{match[2]}{blocks[match[1]]}", text)
    if placed != set(blocks):
        raise LookupError(f"{', '.join(sorted(set(blocks) - placed))}: no page has these comments")


def renew_pages() -> None:
    """Write the pages that changed, so that Sphinx reads no others again."""
    for path, text in reference_pages():
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    renew_pages()
