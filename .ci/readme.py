"""README's excerpt of a report: downsampled figures, and its table between two comments."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
WIDEST_PX = 1100


def renew_figures(source: Path, target: Path, names: Iterable[str]) -> None:
    """Turn PNG figures of a folder into the JPEGs of another, at most as wide as a page."""
    target.mkdir(exist_ok=True)
    for name in names:
        picture = Image.open(source / f"{name}.png").convert("RGB")
        picture.thumbnail((WIDEST_PX, 10 * WIDEST_PX), Image.Resampling.LANCZOS)
        picture.save(target / f"{name}.jpg", quality=88, optimize=True)


def renew_table(mark: str, table: str) -> None:
    """Put a table between README's comments `mark` and `end of mark`."""
    readme = ROOT / "README.md"
    text, count = re.subn(
        rf"(<!-- {mark} -->\n).*?(<!-- end of {mark} -->)",
        lambda match: match[1] + table + match[2],
        readme.read_text(encoding="utf-8"),
        flags=re.DOTALL,
    )
    if count != 1:
        sys.exit(f"README.md: expected one place for {mark} between two comments, got {count}")
    readme.write_text(text, encoding="utf-8")
