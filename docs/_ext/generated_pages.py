"""Reference pages from the code that they describe, and parts of pages that only Sphinx shows.

GitHub shows a page's text, but neither toctrees nor what directives include. Therefore directives
stand in comments, `<!-- in the site` to `-->`, which Sphinx reads as text; and what a page says in
their place, from `<!-- on GitHub -->` to the next such comment, is left out by Sphinx.
"""

from __future__ import annotations

import re

from sphinx.application import Sphinx

from reference_pages import renew_pages

_GITHUB = re.compile(r"<!-- on GitHub -->\n.*?(?=<!-- in the site\n)", re.DOTALL)
_SITE = re.compile(r"<!-- in the site\n(.*?)\n-->", re.DOTALL)


def write_pages(app: Sphinx) -> None:
    """Renew the pages."""
    renew_pages()


def site_text(text: str) -> str:
    """Text of a page for the site: without GitHub's parts, with those in comments."""
    return _SITE.sub(r"\1", _GITHUB.sub("", text))


def read_page(app: Sphinx, name: str, source: list[str]) -> None:
    """Replace the text of a page that Sphinx has read."""
    source[0] = site_text(source[0])


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the pages with Sphinx."""
    app.connect("builder-inited", write_pages)
    app.connect("source-read", read_page)
    return {"parallel_read_safe": True}
