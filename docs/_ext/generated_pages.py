"""Reference pages and figures from the code that they describe."""

from __future__ import annotations

from pathlib import Path

from sphinx.application import Sphinx

from command_line import command_line_page
from error_table import errors_page
from export_formats import export_formats
from figures import write_figures
from file_keys import key_pages
from scene_formats import scene_format_pages


def write_pages(app: Sphinx) -> None:
    """Write the generated pages, those that changed only, so that Sphinx reads no others again."""
    folder = Path(app.srcdir) / "reference" / "generated"
    folder.mkdir(exist_ok=True)
    pages = {
        "command-line": command_line_page(),
        "errors": errors_page(),
        "export-formats": export_formats(),
        **key_pages(),
        **scene_format_pages(),
    }
    for name, text in pages.items():
        path = folder / f"{name}.md"
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
    write_figures(Path(app.srcdir) / "explanation" / "figures")


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the pages with Sphinx."""
    app.connect("builder-inited", write_pages)
    return {"parallel_read_safe": True}
