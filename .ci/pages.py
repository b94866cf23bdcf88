"""Reports on pages of the documentation: downsampled figures, and blocks between two comments."""

from __future__ import annotations

import io
import os
import re
import sys
from collections.abc import Iterable
from pathlib import Path

from PIL import Image, ImageChops

ROOT = Path(__file__).resolve().parents[1]
EXPLANATION = ROOT / "docs" / "explanation"
PAGES = (
    ROOT / "README.md",
    ROOT / "benchmarks" / "README.md",
    *(EXPLANATION / f"{name}.md" for name in ("accuracy", "performance", "self-localization")),
)
WIDEST_PX = 1100
PLOT_COLORS = 48
SAME_LEVELS = 24  # largest difference between images that are the same, of 255


def renew_figures(source: Path, target: Path, names: Iterable[str]) -> None:
    """Turn PNG figures of a folder into the JPEGs of another, at most as wide as a page."""
    target.mkdir(exist_ok=True)
    for name in names:
        image = Image.open(source / f"{name}.png").convert("RGB")
        image.thumbnail((WIDEST_PX, 10 * WIDEST_PX), Image.Resampling.LANCZOS)
        image.save(target / f"{name}.jpg", quality=88, optimize=True)


def write_image_file(path: Path, data: bytes) -> None:
    """Write a PNG or JPEG file, unless there is one whose pixels nobody can tell from these.

    Encoders differ from version to version, and drivers in roundings: by up to 19
    levels in a pixel.
    """
    if path.is_file():
        with Image.open(path) as old, Image.open(io.BytesIO(data)) as new:
            difference = ImageChops.difference(old.convert("RGB"), new.convert("RGB"))
            levels = max(most for _, most in difference.getextrema())
            if old.size == new.size and levels <= SAME_LEVELS:
                return
    path.write_bytes(data)


def save_jpeg(image: Image.Image, path: Path, max_bytes: int, max_quality: int = 92) -> None:
    """Save an image as the best JPEG that fits, unless its pixels are there already."""
    for quality in range(max_quality, 20, -4):
        data = io.BytesIO()
        image.save(data, "JPEG", quality=quality, optimize=True)
        if data.tell() <= max_bytes:
            break
    write_image_file(path, data.getvalue())


def block_of(mark: str, pages: Iterable[Path] = PAGES) -> str:
    """Text between the comments `mark` and `end of mark` of the first page that holds them."""
    for page in pages:
        found = _pattern(mark).search(page.read_text(encoding="utf-8"))
        if found is not None:
            return found[0].partition("\n")[2].rpartition("<!--")[0]
    sys.exit(f"{mark}: expected a page that has a place for it between two comments, got none")


def renew_plots(source: Path, target: Path, names: Iterable[str]) -> None:
    """Copy PNG plots of a folder to another, at most as wide as a page, with few colors."""
    target.mkdir(parents=True, exist_ok=True)
    for name in names:
        image = Image.open(source / f"{name}.png").convert("RGB")
        image.thumbnail((WIDEST_PX, 10 * WIDEST_PX), Image.Resampling.LANCZOS)
        image.quantize(PLOT_COLORS).save(target / f"{name}.png", optimize=True)


def renew_block(mark: str, block: str, pages: Iterable[Path] = PAGES) -> None:
    """Put a block between the comments `mark` and `end of mark` of each page that holds them.

    Links of the block are relative to the project's root; on a page they are relative to it.
    """
    pattern = _pattern(mark)
    holders = 0
    for page in pages:
        text = page.read_text(encoding="utf-8")
        places = len(pattern.findall(text))
        if places > 1:
            sys.exit(f"{page}: expected one place for {mark} between two comments, got {places}")
        if places:
            holders += 1
            moved = _moved_links(block, page)
            text = pattern.sub(lambda match, moved=moved: match[1] + moved + match[2], text)
            page.write_text(text, encoding="utf-8")
    if not holders:
        sys.exit(f"{mark}: expected a page that has a place for it between two comments, got none")


def _pattern(mark: str) -> re.Pattern[str]:
    """Both comments of a mark, with the text between them."""
    return re.compile(rf"(<!-- {mark} -->\n).*?(<!-- end of {mark} -->)", re.DOTALL)


def _moved_links(block: str, page: Path) -> str:
    return re.sub(
        r"\]\((?!\w+:|#)([^)]+)\)",
        lambda match: f"]({os.path.relpath(ROOT / match[1], page.parent)})",
        block,
    )
