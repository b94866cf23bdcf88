"""Figure of the objects: SVG from class names that the package has."""

from __future__ import annotations

from dataclasses import dataclass

from figure_style import box, path, svg, text

_COLUMNS_PX = (10, 204, 398, 592)
_BOX_PX = (136, 58)


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
    Node("Scene", "geometry and light", 0, 42),
    Node("Stage", "scene on a back end", 1, 42),
    Node("Renderer", "a sensor on a stage", 2, 42),
    Node("Frame", "image and channels", 3, 42),
    Node("Vehicle.body", "what cameras see", 1, 172),
    Node("Vehicle.sensors", "each with its mount", 2, 172),
    Node("WorldState", "poses and time", 3, 172),
    Node("Drive", "scene, vehicle, path", 0, 326, "omnisim.runs.drive"),
    Node("RunFolder", "all sensors, all steps", 1, 326, "omnisim.runs.run_folder"),
    Node("Plan", "what varies, and how", 2, 326, "omnisim.datasets.generate.plan"),
    Node("shard-000000.tar", "labeled images", 3, 326, None),
)


def object_figure() -> str:
    """The figure as SVG."""
    parts = [
        text(10, 28, "One image", "muted name"),
        text(10, 158, "On a robot", "muted name"),
        text(10, 312, "Many images", "muted name"),
        text(398, 312, "Data sets", "muted name"),
        box(192, 142, 354, 122, "group"),
        text(369, 252, "Vehicle: a robot and its sensors", anchor="middle"),
        *(_node(node) for node in NODES),
        *(_across(column, 71, call) for column, call in enumerate(("Stage", "open", "render"))),
        path("M272 172V102"),
        text(280, 128, "body", "call"),
        path("M466 172V102"),
        text(474, 128, "sensor", "call"),
        path("M592 201H563V74"),
        text(571, 128, "pose", "call"),
        _across(0, 355, "drive"),
        _across(2, 355, "generate"),
    ]
    return svg("Objects of omnisim", 396, parts)


def _node(node: Node) -> str:
    left, (width, height) = _COLUMNS_PX[node.column], _BOX_PX
    middle = left + width // 2
    return "\n".join(
        (
            box(left, node.top_px, width, height),
            text(middle, node.top_px + 25, node.name, "code", "middle"),
            text(middle, node.top_px + 45, node.line, "muted", "middle"),
        )
    )


def _across(column: int, middle_px: int, call: str) -> str:
    """Arrow from a column to the next, below its call."""
    start, end = _COLUMNS_PX[column] + _BOX_PX[0], _COLUMNS_PX[column + 1]
    label = text((start + end) / 2, middle_px - 9, call, "call", "middle")
    return f"{path(f'M{start} {middle_px}H{end - 2}')}\n{label}"
