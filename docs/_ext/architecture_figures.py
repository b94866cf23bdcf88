"""Figures of the architecture, as SVG: the rooms from the package's imports, and ways through them.

`python docs/_ext/figures.py` writes them. Colors follow the reader's light or dark
theme.
"""

from __future__ import annotations

import ast
import html
import textwrap
from collections.abc import Iterator
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "omnisim"
FOLDER = ROOT / "docs" / "explanation" / "figures"
# Functions on the way of each subject, in the order in which they are entered.
WAYS: dict[str, tuple[str, ...]] = {
    "a frame": (
        "rendering.renderer:Renderer.render",
        "rendering.backend:CameraBackend.take",
        "rendering.opengl.pipeline:Pipeline.render",
        "rendering.opengl.drawing.cube_pass:CubePass.render",
        "rendering.opengl.culling.cluster_culling:ClusterCuller.run",
        "rendering.opengl.drawing.cluster_drawer:ClusterDrawer.draw",
        "rendering.opengl.capture.image_pass:RemapPass.draw",
        "rendering.opengl.pipeline:Pipeline.read_encoded",
        "ground_truth.frame:Frame.save",
    ),
    "a hit": (
        "rendering.backend:CameraBackend.ground_truth",
        "rendering.opengl_camera:OpenGLCamera.hit_source",
        "rendering.truth.ground_truth:GroundTruth.channels",
        "rendering.cube_backend:CubeHits.hits",
        "rendering.opengl.ground_truth.ray_hit_pass:RayHitPass.render",
        "rendering.opengl.ground_truth.visibility_pass:VisibilityPass.render",
        "rendering.opengl.ground_truth.ray_hit_pass:read_hits",
        "ground_truth.channel_files:write_sidecars",
    ),
    "a run": (
        "robots.robot_file:load_robot",
        "sensors.sensor_registry:parse_mounts",
        "runs.route:plan_route",
        "runs.contacts:find_contacts",
        "runs.drive:PlannedDrive.record",
        "sensors.sensor:RenderedSensor.instrument",
        "rendering.stage:Stage.open",
        "runs.run_folder:open_run",
        "sensors.sensor:Instrument.measure",
        "sensors.omnicamera.mounted_omnicamera:CameraMeasurement.save",
    ),
    "a shard": (
        "datasets.generate.prepared_plan:PreparedPlan.read",
        "datasets.generate.generate:Generation.run",
        "datasets.generate.shard:ShardMaker.steps",
        "datasets.generate.draw:draw_which",
        "datasets.generate.draw:draw",
        "rendering.stage:Stage.open",
        "rendering.renderer:Renderer.render",
        "datasets.tar_file:write_tar",
        "datasets.dataset_manifest:Manifest.to_json",
    ),
}
_STYLE = """
  text { font: 13px system-ui, sans-serif; fill: #24292f; }
  .name { font-weight: 600; }
  .quiet { font-size: 11.5px; fill: #57606a; }
  rect { fill: #f6f8fa; stroke: #8c959f; }
  path { fill: none; stroke: #0969da; stroke-opacity: 0.7; }
  marker path { fill: #0969da; stroke: none; }
  @media (prefers-color-scheme: dark) {
    text { fill: #e6edf3; } .quiet { fill: #9198a1; }
    rect { fill: #161b22; stroke: #6e7681; }
    path { stroke: #4493f8; } marker path { fill: #4493f8; }
  }"""
_ROW, _BOX, _LEFT = 58, 500, 10  # pixels: distance of rows, width of a box, margin


@cache
def imports() -> frozenset[tuple[str, str]]:
    """Pairs of rooms of which the first imports from the second."""
    pairs = set()
    for path in sorted(PACKAGE.rglob("*.py")):
        room = path.relative_to(PACKAGE).parts[0]
        if room.endswith(".py"):  # of the package itself
            continue
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("omnisim."):
                other = str(node.module).split(".")[1]
                if other != room and (PACKAGE / other).is_dir():
                    pairs.add((room, other))
    return frozenset(pairs)


def rooms() -> list[str]:
    """Rooms from top to bottom: each imports from those below it only.

    Raises:
        graphlib.CycleError: rooms that import from each other.
    """
    below: dict[str, set[str]] = {}
    for room, other in imports():
        below.setdefault(room, set()).add(other)
    level: dict[str, int] = {}
    for room in TopologicalSorter(below).static_order():
        level[room] = 1 + max((level[one] for one in below.get(room, ())), default=0)
    return sorted(level, key=lambda room: (-level[room], room))


def arrows() -> list[tuple[str, str]]:
    """Imports between rooms that no way over a third room implies."""
    edges = imports()
    order = rooms()

    def reaches(start: str, end: str) -> bool:
        return any(other == end or reaches(other, end) for room, other in edges if room == start)

    return [
        (a, b)
        for a in order
        for b in order
        if (a, b) in edges and not any(reaches(c, b) for x, c in edges if x == a and c != b)
    ]


def rooms_figure() -> str:
    """SVG of the rooms, from top to bottom, with their subjects and arrows."""
    order, parts = rooms(), []
    for row, room in enumerate(order):
        y = 10 + _ROW * row
        parts.append(_box(_LEFT, y, _BOX, 46))
        parts.append(_text(_LEFT + 10, y + 19, f"{room}/", "name"))
        parts.append(_text(_LEFT + 10, y + 37, _subject(room), "quiet"))
    for a, b in arrows():
        start, end = (33 + _ROW * order.index(room) for room in (a, b))
        start, end = start + 6, end - 6
        right = _LEFT + _BOX
        reach = 18 + 17 * (order.index(b) - order.index(a))
        parts.append(
            f'<path d="M{right} {start} C{right + reach} {start} {right + reach} {end} '
            f'{right + 2} {end}" stroke-width="1.5" marker-end="url(#tip)"/>'
        )
    return _svg("Rooms of omnisim", 600, 10 + _ROW * len(order), parts)


def ways_figure() -> str:
    """SVG of the ways of a frame, a hit, a run and a shard through the modules."""
    column, parts = 285, []
    for number, (subject, steps) in enumerate(WAYS.items()):
        x = _LEFT + column * number
        parts.append(_text(x, 24, f"The way of {subject}", "name"))
        for row, step in enumerate(steps):
            y = 40 + 60 * row
            module, name = step.split(":")
            parts.append(_box(x, y, column - 20, 42))
            parts.append(_text(x + 8, y + 18, name, "name"))
            parts.append(_text(x + 8, y + 34, _short(module), "quiet"))
            if row + 1 < len(steps):
                parts.append(
                    f'<path d="M{x + 30} {y + 42} V{y + 58}" stroke-width="1.5" '
                    'marker-end="url(#tip)"/>'
                )
    height = 40 + 60 * max(map(len, WAYS.values()))
    return _svg("Ways through the modules", column * len(WAYS) + 10, height, parts)


def figures() -> Iterator[tuple[Path, str]]:
    """Path and text of each figure."""
    yield FOLDER / "rooms.svg", rooms_figure()
    yield FOLDER / "ways.svg", ways_figure()


def _subject(room: str) -> str:
    doc = ast.get_docstring(ast.parse((PACKAGE / room / "__init__.py").read_text("utf-8"))) or ""
    return textwrap.shorten(doc.split("\n\n")[0].partition(": ")[2].rstrip("."), 78)


def _short(module: str) -> str:
    """Path of a module, its inner folders left out where it is long."""
    parts = module.split(".")
    path = "/".join(parts) + ".py"
    return path if len(path) <= 38 else f"{parts[0]}/…/{parts[-1]}.py"


def _box(x: int, y: int, width: int, height: int) -> str:
    return f'<rect x="{x}" y="{y}" width="{width}" height="{height}" rx="6"/>'


def _text(x: int, y: int, text: str, kind: str, anchor: str = "start") -> str:
    words = html.escape(text, quote=False)
    return f'<text x="{x}" y="{y}" class="{kind}" text-anchor="{anchor}">{words}</text>'


def _svg(title: str, width: int, height: int, parts: list[str]) -> str:
    tip = (
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" '
        'markerHeight="7" markerUnits="userSpaceOnUse" orient="auto">'
        '<path d="M0 0 8 4 0 8z"/></marker></defs>'
    )
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
            f'width="{width}" height="{height}" role="img">',
            f"<title>{title}</title>", f"<style>{_STYLE}\n</style>", tip, *parts, "</svg>", "",
        ]
    )  # fmt: skip
