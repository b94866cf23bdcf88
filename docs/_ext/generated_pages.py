"""Reference pages and figures from the code that they describe."""

from __future__ import annotations

from pathlib import Path

from sphinx.application import Sphinx

from figures import write_figures
from reference_pages import renew_pages


def write_pages(app: Sphinx) -> None:
    """Renew the pages and figures."""
    renew_pages()
    write_figures(Path(app.srcdir) / "explanation" / "figures")


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the pages with Sphinx."""
    app.connect("builder-inited", write_pages)
    return {"parallel_read_safe": True}
