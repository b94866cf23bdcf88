"""`omnisim scene convert`."""

from __future__ import annotations

from omnisim.apps.cli.console import out, pluralize, print_note
from omnisim.apps.cli.worlds.requests import SceneConvertRequest
from omnisim.core.files.atomic_file import atomic_write, check_distinct, check_suffix, check_target
from omnisim.scene import read_scene
from omnisim.scene.files.source import resolve_source
from omnisim.scene.formats.gltf.writer import write_glb


def run(request: SceneConvertRequest) -> None:
    """Write a scene as GLB, and print notes on unsupported contents."""
    check_suffix(request.output, ".glb")
    check_target(request.output)
    source = resolve_source(request.world.scene)
    check_distinct(
        {"the GLB file": request.output},
        {"the scene's mesh file": source.mesh_file, "the scene": source.toml},
    )
    scene = read_scene(
        request.world.scene,
        request.world.up_axis,
        request.world.meters_per_unit,
        request.world.resources or (),
        animation="none",
    )
    for notice in scene.notices:
        print_note(notice)
    with atomic_write(request.output) as partial:
        left_out = write_glb(scene, partial)
    for notice in left_out:
        print_note(notice)
    size_mb = request.output.stat().st_size / 1e6
    instances = pluralize(len(scene.instance_names), "instance")
    out.print(f"{request.output}: {instances}, {size_mb:.1f} MB", markup=False)
