"""Figure of the objects: SVG in light and dark, from class names that the package has.

`python docs/_ext/object_figure.py` writes it; a test compares the file with the code.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from xml.sax.saxutils import escape

FIGURE = Path(__file__).resolve().parents[1] / "explanation" / "objects.svg"

_SIZE_PX = (960, 520)
_COLUMNS_PX = (20, 265, 510, 755)
_BOX_PX = (185, 66)
_STYLE = """
text { font: 13px system-ui, sans-serif; fill: #24292f; text-anchor: middle; }
.name { font: bold 15px monospace; }
.call { font: 11px monospace; fill: #57606a; }
.row { font-weight: 600; fill: #57606a; text-anchor: start; }
.box { fill: #f6f8fa; stroke: #8c959f; }
.group { fill: none; stroke: #8c959f; stroke-dasharray: 5 4; }
.arrow { fill: none; stroke: #0969da; stroke-width: 1.5; marker-end: url(#tip); }
marker path { fill: #0969da; }
@media (prefers-color-scheme: dark) {
  text { fill: #e6edf3; } .call, .row { fill: #9198a1; }
  .box { fill: #161b22; stroke: #6e7681; } .group { stroke: #6e7681; }
  .arrow { stroke: #4493f8; } marker path { fill: #4493f8; }
}
""".strip()


@dataclass(frozen=True)
class Node:
    """Box of one object.

    Attributes:
        name: class, attribute of a class, or file.
        line: role, in a few words.
        column: from 0, left to right.
        top_px: upper edge.
        module: has the class; None: a file.
    """

    name: str
    line: str
    column: int
    top_px: int
    module: str | None = "omnisim"


NODES = (
    Node("Scene", "geometry, light, labels", 0, 62),
    Node("Stage", "the scene on a back end", 1, 62),
    Node("Renderer", "one sensor on the stage", 2, 62),
    Node("Frame", "image, channels, pose", 3, 62),
    Node("Vehicle.body", "what cameras see of it", 1, 232),
    Node("Vehicle.sensors", "each with its mount", 2, 232),
    Node("WorldState", "poses and time", 3, 232),
    Node("Drive", "scene, vehicle, path", 0, 425, "omnisim.runs.drive"),
    Node("RunFolder", "every sensor, every step", 1, 425, "omnisim.runs.run_folder"),
    Node("Plan", "what varies, and how", 2, 425, "omnisim.datasets.generate.plan"),
    Node("shard-000000.tar", "labeled images", 3, 425, None),
)


def object_figure() -> str:
    """The figure as SVG."""
    width, height = _SIZE_PX
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" role="img">',
        "<title>Objects of omnisim</title>",
        f"<style>{_STYLE}</style>",
        '<defs><marker id="tip" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="7" '
        'markerHeight="7" orient="auto"><path d="M0 0L10 5L0 10z"/>'
        "</marker></defs>",
        _text(20, 36, "row", "One image"),
        _text(20, 216, "row", "On a robot"),
        _text(20, 400, "row", "Many images"),
        _text(510, 400, "row", "Data sets"),
        '<rect class="group" x="250" y="190" width="460" height="150" rx="10"/>',
        _text(480, 330, "", "Vehicle: a robot and its sensors"),
    ]
    parts += [_box(node) for node in NODES]
    parts += [
        _across(0, 95, "Stage"),
        _across(1, 95, "open"),
        _across(2, 95, "render"),
        _arrow("M357 232V130"),
        _text(385, 164, "call", "body"),
        _arrow("M602 232V130"),
        _text(637, 164, "call", "sensor"),
        _arrow("M755 265H725V98"),
        _text(752, 164, "call", "pose"),
        _across(0, 458, "drive"),
        _across(2, 458, "generate"),
        "</svg>",
    ]
    return "\n".join(parts) + "\n"


def _box(node: Node) -> str:
    left, (width, height) = _COLUMNS_PX[node.column], _BOX_PX
    middle = left + width // 2
    return "\n".join(
        (
            f'<rect class="box" x="{left}" y="{node.top_px}" width="{width}" height="{height}" '
            'rx="6"/>',
            _text(middle, node.top_px + 28, "name", node.name),
            _text(middle, node.top_px + 51, "", node.line),
        )
    )


def _across(column: int, middle_px: int, call: str) -> str:
    """Arrow from a column to the next, below its call."""
    start, end = _COLUMNS_PX[column] + _BOX_PX[0], _COLUMNS_PX[column + 1]
    text = _text((start + end) // 2, middle_px - 10, "call", call)
    return f"{_arrow(f'M{start} {middle_px}H{end - 2}')}\n{text}"


def _arrow(path: str) -> str:
    return f'<path class="arrow" d="{path}"/>'


def _text(x: int, y: int, kind: str, text: str) -> str:
    return f'<text class="{kind}" x="{x}" y="{y}">{escape(text)}</text>'


if __name__ == "__main__":
    FIGURE.write_text(object_figure(), encoding="utf-8")
