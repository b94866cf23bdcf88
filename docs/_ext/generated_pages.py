"""Reference pages from the code that they describe."""

from __future__ import annotations

from sphinx.application import Sphinx

from reference_pages import renew_pages


def write_pages(app: Sphinx) -> None:
    """Renew the pages."""
    renew_pages()


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the pages with Sphinx."""
    app.connect("builder-inited", write_pages)
    return {"parallel_read_safe": True}
