"""Blocks of measures between two comments of the documentation's pages."""

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def pages(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / ".ci"))
    import pages

    yield pages
    del sys.modules["pages"]


def test_a_block_is_renewed_on_each_page_that_holds_it(pages, tmp_path, monkeypatch):
    monkeypatch.setattr(pages, "ROOT", tmp_path)
    (tmp_path / "docs").mkdir()
    with_block, without = tmp_path / "docs" / "a.md", tmp_path / "b.md"
    with_block.write_text("# A\n<!-- fps -->\nold\n<!-- end of fps -->\nrest\n")
    without.write_text("# B\n")
    block = "![f](results/f.jpg), [page](https://a.org), \\1\n"
    pages.renew_block("fps", block, (with_block, without))
    moved = "![f](../results/f.jpg), [page](https://a.org), \\1\n"
    assert with_block.read_text() == f"# A\n<!-- fps -->\n{moved}<!-- end of fps -->\nrest\n"
    assert without.read_text() == "# B\n"
    with pytest.raises(SystemExit, match="peers: expected a page"):
        pages.renew_block("peers", block, (with_block, without))


@pytest.mark.parametrize("mark", ["validation", "experiments", "fps", "peers"])
def test_some_page_holds_each_block(pages, mark):
    places = [page.read_text(encoding="utf-8").count(f"<!-- {mark} -->") for page in pages.PAGES]
    assert sum(places) >= 1
    assert max(places) == 1
