"""Figures of the architecture, as SVG: rooms from the package's imports, ways through them."""

from __future__ import annotations

import ast
import textwrap
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

from figure_style import WIDTH, box, path, svg, text

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "omnisim"
# Functions on the way of each subject, in the order in which they are entered.
WAYS: dict[str, tuple[str, ...]] = {
    "a frame": (
        "rendering.renderer:Renderer.render",
        "rendering.contract:CameraBackend.begin",
        "rendering.opengl.camera_frame:CameraFrame.begin",
        "rendering.opengl.camera_frame:CameraFrame.draw",
        "rendering.opengl.camera_frame:CubePass.draw",
        "rendering.opengl.culling.cluster_culling:ClusterCuller.run",
        "rendering.opengl.surfaces.cluster_drawer:ClusterDrawer.draw",
        "rendering.opengl.capture.image_pass:RemapPass.draw",
        "ground_truth.frame:Frame.save",
    ),
    "a hit": (
        "rendering.truth:ground_truth_of",
        "rendering.opengl.opengl_camera:OpenGLCamera.hit_source",
        "rendering.truth:GroundTruth.channels",
        "rendering.opengl.hits.drawn_hits:CubeHits.hits",
        "rendering.opengl.hits.ray_hit_pass:RayHitPass.render",
        "rendering.opengl.hits.visibility_pass:VisibilityPass.render",
        "rendering.opengl.hits.ray_hit_pass:RayHitPass.begin_reading",
        "ground_truth.channel_files:write_sidecars",
    ),
    "a run": (
        "robots.robot_file:load_robot",
        "sensors.sensor_registry:parse_sensors",
        "runs.route:plan_route",
        "runs.contacts:find_contacts",
        "runs.drive:PlannedDrive.record",
        "rendering.camera.omnicamera:OmniCamera.open",
        "rendering.stage:Stage.open_camera",
        "runs.run_folder:open_run",
        "rendering.renderer:Renderer.begin",
        "rendering.renderer:RecordedFrame.save",
    ),
    "a shard": (
        "datasets.generate.prepared_plan:PreparedPlan.read",
        "datasets.generate.generate:Generation.run",
        "datasets.generate.shard:ShardMaker.steps",
        "datasets.generate.draw:draw_indices",
        "datasets.generate.draw:draw",
        "rendering.stage:Stage.open",
        "rendering.renderer:Renderer.submit",
        "datasets.generate.shard:write_tar",
        "datasets.generate.samples:SampleManifest.to_json",
    ),
}
_ROW, _BOX, _LEFT = 58, 560, 10  # pixels: distance of rows, width of a box, margin


@cache
def imports() -> frozenset[tuple[str, str]]:
    """Pairs of rooms of which the first imports from the second."""
    pairs = set()
    for file in sorted(PACKAGE.rglob("*.py")):
        room = file.relative_to(PACKAGE).parts[0]
        if room.endswith(".py"):  # of the package itself
            continue
        for node in ast.walk(ast.parse(file.read_text("utf-8"))):
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
        parts.append(box(_LEFT, y, _BOX, 46))
        parts.append(text(_LEFT + 10, y + 19, f"{room}/", "code"))
        parts.append(text(_LEFT + 10, y + 37, _subject(room), "muted"))
    for a, b in arrows():
        start, end = (33 + _ROW * order.index(room) for room in (a, b))
        start, end = start + 6, end - 6
        right = _LEFT + _BOX
        reach = 18 + 17 * (order.index(b) - order.index(a))
        parts.append(
            path(
                f"M{right} {start} C{right + reach} {start} {right + reach} {end} {right + 2} {end}"
            )
        )
    return svg("Subpackages of omnisim", 10 + _ROW * len(order), parts)


def ways_figure() -> str:
    """SVG of the ways of a frame, a hit, a run and a shard through the modules, two by two."""
    column, parts = (WIDTH - 10) // 2, []
    heights = [50 * len(steps) + 50 for steps in WAYS.values()]
    for number, (subject, steps) in enumerate(WAYS.items()):
        x, top = _LEFT + column * (number % 2), max(heights[:2]) * (number // 2)
        parts.append(text(x, top + 24, f"The path of {subject}", "name"))
        for row, step in enumerate(steps):
            y = top + 36 + 50 * row
            module, name = step.split(":")
            parts.append(box(x, y, column - 10, 38))
            parts.append(text(x + 8, y + 16, name, "code"))
            parts.append(text(x + 8, y + 32, f"{module.replace('.', '/')}.py", "muted"))
            if row + 1 < len(steps):
                parts.append(path(f"M{x + 30} {y + 38}V{y + 49}"))
    return svg("Paths through the modules", max(heights[:2]) + max(heights[2:]), parts)


def _subject(room: str) -> str:
    doc = ast.get_docstring(ast.parse((PACKAGE / room / "__init__.py").read_text("utf-8"))) or ""
    return textwrap.shorten(doc.split("\n\n")[0].partition(": ")[2].rstrip("."), 78)
