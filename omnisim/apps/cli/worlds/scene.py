"""`omnisim scene` and `omnisim bake`."""

from __future__ import annotations

import dataclasses
import json
import math
import time
from pathlib import Path
from typing import Any

import numpy as np
from rich.markup import escape
from rich.table import Table

from omnisim.apps.cli.console import out, pluralize, print_note, track
from omnisim.apps.cli.inputs import load_requested_scene, read_requested_scene
from omnisim.apps.cli.worlds.requests import BakeRequest, SceneConvertRequest, SceneRequest
from omnisim.core.errors import OutputError, printable
from omnisim.core.extras import require_extra
from omnisim.core.files.atomic_file import atomic_write, check_distinct, check_suffix, check_target
from omnisim.core.short_repr import number_text
from omnisim.rendering.opengl.world.vertex_records import gpu_bytes
from omnisim.rendering.reflection_kinds import reflection_kinds
from omnisim.scene import Scene, summary
from omnisim.scene.files.load import NO_BAKED_LIGHT, resolve_source
from omnisim.scene.formats.gltf.writer import write_glb
from omnisim.scene.labels import find_labels, read_label_file
from omnisim.scene.light.lighting import is_even, light_summary
from omnisim.scene.model import LightKind

SHOWN = 20  # maximum number of instances in the table
_MIN_NAME = 20  # columns of names, before details are left out


def show(request: SceneRequest) -> None:
    """Print the contents of a scene as tables or JSON, and plot it on request."""
    if request.plot is not None:
        require_extra("plots", "--plot")
        from omnisim.plots.style import check_plot_target

        check_plot_target(request.plot)
    scene = read_requested_scene(request.world)
    if request.labels is not None:
        scene = dataclasses.replace(scene, labels=read_label_file(request.labels))
    document = describe(scene)
    if request.json:
        out.print(json.dumps(document, indent=2))
    else:
        _print_tables(document, request.all)
    if request.plot is not None:
        from omnisim.plots.scene_plot import scene_figure
        from omnisim.plots.style import write_plot

        write_plot(request.plot, scene_figure(scene))
        if not request.json:
            out.print(f"{request.plot}: the scene from above")


def describe(scene: Scene) -> dict[str, Any]:
    """Describe a scene with JSON-serializable values."""
    labels, reflections = find_labels(scene), reflection_kinds(scene)
    mesh_bytes, texture_bytes = summary.memory_bytes(scene)
    low, high = scene.bounds_m()
    paths = [(path.name, np.array(path.waypoints_m)) for path in scene.paths]
    lights = () if is_even(scene.lighting) else scene.lighting.lights
    return {
        "scene": scene.name,
        "bounds_m": [low.tolist(), high.tolist()],
        "triangles": scene.triangle_count,
        "meshes": len(scene.meshes),
        "materials": len(scene.materials),
        "textures": len(summary.scene_textures(scene)),
        "mesh_bytes": mesh_bytes,
        "texture_bytes": texture_bytes,
        "gpu_bytes": gpu_bytes(scene),
        "floors": [dataclasses.asdict(floor) for floor in summary.floors(scene)],
        "starts": [dataclasses.asdict(start) for start in summary.start_summaries(scene)],
        "cameras": [
            {**vars(camera), "lens": None if camera.lens is None else camera.lens.parameters()}
            for camera in scene.cameras
        ],
        "paths": [
            {
                "name": name,
                "waypoints": len(points),
                "length_m": float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum()),
            }
            for name, points in paths
        ],
        "ambient": list(scene.lighting.ambient),
        "exposure": scene.lighting.exposure,
        "light": light_summary(scene.lighting),
        "lights": [
            {"kind": light.kind.value, "intensity": light.intensity, "color": list(light.color)}
            | (
                {"direction": light.direction.tolist()}
                if light.kind is LightKind.DIRECTIONAL
                else {"position_m": light.position_m.tolist()}
            )
            for light in lights
        ],
        "background": list(scene.background),
        "classes": [
            {
                "id": kind.id,
                "name": kind.name,
                "instances": sum(label.class_id == kind.id for label in labels.instances),
            }
            for kind in labels.classes
        ],
        "classes_from": labels.source,
        "landmarks": [
            {"name": each.name, "position_m": list(each.position_m)} for each in scene.landmarks
        ],
        "dynamic_objects": [
            {"name": each.name, "triangles": each.shape.triangle_count} for each in scene.objects
        ],
        "instances": [
            dataclasses.asdict(each) | {"reflections": list(reflections.get(each.name, ()))}
            for each in summary.instance_summaries(scene)
        ],
        "notices": list(scene.notices),
    }


def _print_tables(document: dict[str, Any], shows_all: bool) -> None:
    for name, text in _lines(document):
        out.print(f"{name:11}{printable(text)}")
    ranked = sorted(document["instances"], key=lambda each: -each["triangles"])
    shown = ranked if shows_all else ranked[:SHOWN]
    rows = [_row(instance) for instance in shown]
    titles = ["class", "triangles", "size (m)", "center (m)", "textures"]
    if any(row[-1] for row in rows):
        titles.append("reflects by")
    rows = [row[: 1 + len(titles)] for row in rows]
    widths = [
        max([len(title), *(len(row[index]) for row in rows)])
        for index, title in enumerate(titles, 1)
    ]
    # a narrow terminal leaves out details, then truncates names
    needed = min(_MIN_NAME, max((len(row[0]) for row in rows), default=0))
    for title in ("textures", "center (m)", "size (m)"):
        if out.is_terminal and _name_width(widths) < needed:
            index = titles.index(title)
            del titles[index], widths[index]
            rows = [(*row[: index + 1], *row[index + 2 :]) for row in rows]
    left = max(8, _name_width(widths)) if out.is_terminal else None
    table = Table(box=None, pad_edge=False, collapse_padding=True)
    table.add_column("instance", no_wrap=True, max_width=left)
    for title, width in zip(titles, widths, strict=True):
        table.add_column(title, no_wrap=True, min_width=width, justify="right")
    for row in rows:
        table.add_row(*map(escape, row))
    out.print(table)
    if len(shown) < len(ranked):
        out.print(f"and {len(ranked) - len(shown)} smaller ones: --all")
    for notice in document["notices"]:
        out.print(f"note: {printable(notice)}")


def _lines(document: dict[str, Any]) -> list[tuple[str, str]]:
    low, high = np.array(document["bounds_m"])
    size_m = float((high - low).max())  # of which the decimals resolve a hundredth
    digits = 2 if size_m <= 0.0 else max(2, 2 - math.floor(math.log10(size_m)))
    mesh_mb, texture_mb, gpu_mb = (
        f"{document[f'{kind}_bytes'] / 1e6:.1f} MB" for kind in ("mesh", "texture", "gpu")
    )
    textures = pluralize(document["textures"], "texture")
    floor_heights = ", ".join(f"{floor['height_m']:z.2f} m" for floor in document["floors"])
    lines = [
        ("scene", document["scene"]),
        ("instances", f"{len(document['instances'])}, {document['triangles']:,} triangles"),
        ("memory", f"meshes {mesh_mb}, {textures} {texture_mb}; on the GPU about {gpu_mb}"),
        ("bounds", f"{_point(low, digits)} to {_point(high, digits)} m"),
        ("floors", floor_heights or "none"),
    ]
    for start in document["starts"]:
        floor = "no floor" if start["floor_m"] is None else f"floor at {start['floor_m']:z.2f} m"
        at_m = np.array(start["position_m"])
        if np.any((at_m < low) | (at_m > np.where([True, True, False], high, np.inf))):
            floor += ", outside the bounds"
        place = f"{_point(at_m, digits)} m, yaw {number_text(start['yaw_deg'])}°"
        lines.append(("start", f"{start['name'] or 'camera'}: {place}, {floor}"))
    for camera in document["cameras"]:
        yaw, pitch = (number_text(camera[key]) for key in ("yaw_deg", "pitch_deg"))
        place = f"{_point(camera['position_m'], digits)} m, yaw {yaw}°, pitch {pitch}°"
        lens = "no lens" if camera["lens"] is None else camera["lens"]["model"]
        lines.append(("camera", f"{camera['name']}: {place}, {lens}"))
    for path in document["paths"]:
        count = pluralize(path["waypoints"], "waypoint")
        lines.append(("path", f"{path['name']}: {count}, {path['length_m']:.1f} m"))
    classes = [f"{kind['name']} {kind['instances']}" for kind in document["classes"]]
    lines += [
        ("lights", document["light"]),
        ("classes", f"{', '.join(classes)} (by {document['classes_from']})"),
    ]
    for title, key in (("landmarks", "landmarks"), ("moving", "dynamic_objects")):
        if document[key]:
            lines.append((title, ", ".join(each["name"] for each in document[key])))
    return lines


def _name_width(widths: list[int]) -> int:
    """Columns of the terminal that cells of given widths leave to names."""
    return out.console.width - sum(widths) - len(widths)


def _row(instance: dict[str, Any]) -> tuple[str, ...]:
    low, high = np.array(instance["min_m"]), np.array(instance["max_m"])
    sizes = [f"{width}×{height}" for width, height in instance["textures_px"]]
    return (
        printable(instance["name"]),
        printable(instance["class_name"]),
        f"{instance['triangles']:,}",
        "×".join(_short(size) for size in high - low),
        " ".join(_short(value) for value in 0.5 * (low + high)),
        " ".join([*sizes[:1], *([f"+{len(sizes) - 1}"] if len(sizes) > 1 else [])]),
        " ".join(instance["reflections"]),
    )


def _short(value: float) -> str:
    """Three significant digits, but all of them before the point."""
    return number_text(value, 3 if abs(value) < 999.5 else len(f"{value:.0f}"))


def _point(values: Any, decimals: int) -> str:
    return "(" + ", ".join(f"{value:z.{decimals}f}" for value in values) + ")"


def convert(request: SceneConvertRequest) -> None:
    """Write a scene as GLB, and print notes on unsupported contents."""
    check_suffix(request.output, ".glb")
    check_target(request.output)
    _check_distinct(request.world.scene, "the GLB file", request.output)
    scene = load_requested_scene(request.world, animation="none")
    with atomic_write(request.output) as partial:
        left_out = write_glb(scene, partial)
    for notice in left_out:
        print_note(notice)
    size_mb = request.output.stat().st_size / 1e6
    instances = pluralize(len(scene.instance_names), "instance")
    out.print(f"{request.output}: {instances}, {size_mb:.1f} MB")


def bake(request: BakeRequest) -> None:
    """Bake a scene's light, and print its size."""
    require_extra("bake", "omnisim bake")
    from omnisim.rendering.baking.bake import estimate
    from omnisim.rendering.baking.baked_files import bake_of, bake_scene
    from omnisim.rendering.baking.settings import BakeSettings

    output = request.output
    if output is None and not request.estimate:
        raise OutputError("-o: missing: expected the folder of the bake")
    _check_distinct(request.world.scene, "the baked light", output)
    scene = load_requested_scene(request.world, baked=NO_BAKED_LIGHT)
    if scene.objects:
        print_note("dynamic objects are not baked: they are lit by the probes")
    settings = BakeSettings(request.texel_m, request.samples, request.bounces, request.seed)
    began_s = time.monotonic()
    if output is None or request.estimate:
        out.print(f"{request.world.scene}: {estimate(bake_of(scene, settings), request.jobs)}")
        return
    baked = bake_scene(
        scene, output, settings, request.jobs,
        lambda description, total: lambda steps: track(steps, description, total), request.force,
        lambda bake: print_note(estimate(bake, request.jobs)),
    )  # fmt: skip
    if baked is None:
        out.print(f"{output}: already baked; nothing to do")
        return
    width, height = baked.atlas_px
    size_mb = sum(path.stat().st_size for path in output.iterdir()) / 1e6
    out.print(
        f"{output}: {width} × {height} texels of {baked.texel_m:g} m, "
        f"{baked.probes} probes, {size_mb:.1f} MB, {time.monotonic() - began_s:.0f} s"
    )


def _check_distinct(scene: str, what: str, output: Path | None) -> None:
    source = resolve_source(scene)
    check_distinct(
        {what: output}, {"the scene's mesh file": source.mesh_file, "the scene": source.toml}
    )
