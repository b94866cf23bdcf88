"""One style for the documentation's figures: SVG whose colors follow the reader's theme.

Each figure has a panel behind it, so that it stays legible on a page that has the other theme.
"""

from __future__ import annotations

import html

from numpy.typing import NDArray

WIDTH = 740  # pixels: about that of a page's text
AXIS_COLORS = ("red", "green", "blue")  # of x, y and z
_STYLE = """
svg {
  --page: #fff; --ink: #24292f; --muted: #57606a; --fill: #f6f8fa; --edge: #8c959f;
  --red: #cf222e; --green: #1a7f37; --blue: #0969da;
}
@media (prefers-color-scheme: dark) {
  svg {
    --page: #0d1117; --ink: #e6edf3; --muted: #9198a1; --fill: #161b22; --edge: #6e7681;
    --red: #ff7b72; --green: #56d364; --blue: #4493f8;
  }
}
text { font: 13px system-ui, sans-serif; fill: var(--ink); stroke: none; }
.name { font-weight: 600; }
.code { font: 600 13px monospace; }
.call { font: 11px monospace; fill: var(--muted); }
.muted { font-size: 12px; fill: var(--muted); }
.page { fill: var(--page); }
.box { fill: var(--fill); stroke: var(--edge); }
.group { fill: none; stroke: var(--edge); stroke-dasharray: 5 4; }
.line { fill: none; stroke: var(--edge); }
.dots { fill: none; stroke: var(--edge); stroke-dasharray: 2 4; }
.arrow { fill: none; stroke: var(--blue); stroke-width: 1.5; marker-end: url(#tip); }
.point { fill: var(--ink); }
#tip { fill: var(--blue); }
"""
# Text, lines and arrows of a color. A tip takes no color from its line: each has its own.
_COLOR = """
text.{0} {{ fill: var(--{0}); stroke: none; }}
.{0} {{ stroke: var(--{0}); stroke-width: 1.8; fill: none; }}
.{0}.tip {{ marker-end: url(#tip-{0}); }} #tip-{0} {{ fill: var(--{0}); stroke: none; }}
"""
_TIP = (
    '<marker id="{}" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" '
    'markerUnits="userSpaceOnUse" orient="auto"><path d="M0 0 8 4 0 8z"/></marker>'
)


def svg(title: str, height: int, parts: list[str], width: int = WIDTH) -> str:
    """Figure of these parts on its panel."""
    style = _STYLE + "".join(_COLOR.format(color).lstrip() for color in AXIS_COLORS)
    tips = [_TIP.format(name) for name in ("tip", *(f"tip-{color}" for color in AXIS_COLORS))]
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
            f'width="{width}" height="{height}" role="img">',
            f"<title>{html.escape(title, quote=False)}</title>",
            f"<style>{style}</style>", "<defs>", *tips, "</defs>",
            f'<rect class="page" width="{width}" height="{height}" rx="8"/>', *parts, "</svg>", "",
        ]
    )  # fmt: skip


def text(x: float, y: float, words: str, kind: str = "", anchor: str = "start") -> str:
    words = html.escape(words, quote=False)
    return f'<text x="{x:.1f}" y="{y:.1f}" class="{kind}" text-anchor="{anchor}">{words}</text>'


def box(x: float, y: float, width: float, height: float, kind: str = "box") -> str:
    return f'<rect class="{kind}" x="{x}" y="{y}" width="{width}" height="{height}" rx="6"/>'


def path(commands: str, kind: str = "arrow") -> str:
    return f'<path class="{kind}" d="{commands}"/>'


def line(points_px: NDArray, kind: str = "line") -> str:
    """Line through points (n, 2), rounded to a tenth of a pixel."""
    return path("M" + " ".join(f"{x:.1f} {y:.1f}" for x, y in points_px), kind)
