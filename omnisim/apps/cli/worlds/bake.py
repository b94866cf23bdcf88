"""`omnisim bake`."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable

from omnisim.apps.cli.console import out, print_note, track
from omnisim.apps.cli.worlds.requests import BakeRequest
from omnisim.core.errors import OutputError
from omnisim.core.extras import require_extra
from omnisim.core.files.atomic_file import check_distinct
from omnisim.scene import read_scene
from omnisim.scene.files.load import NO_BAKED_LIGHT
from omnisim.scene.files.source import resolve_source


def run(request: BakeRequest) -> None:
    """Bake a scene's light, and print its size."""
    require_extra("bake", "omnisim bake")
    from omnisim.rendering.baking.bake import estimate
    from omnisim.rendering.baking.baked_files import bake_of, bake_scene
    from omnisim.rendering.baking.settings import BakeSettings

    output = request.output
    if output is None and not request.estimate:
        raise OutputError("-o: expected the folder of the bake")
    source = resolve_source(request.world.scene)
    check_distinct(
        {"the baked light": output},
        {"the scene's mesh file": source.mesh_file, "the scene": source.toml},
    )
    scene = read_scene(
        request.world.scene,
        request.world.up_axis,
        request.world.meters_per_unit,
        request.world.resources or (),
        baked=NO_BAKED_LIGHT,
    )
    for notice in scene.notices:
        print_note(notice)
    if scene.objects:
        print_note("dynamic objects are left out: probes light them")
    settings = BakeSettings(request.texel_m, request.samples, request.bounces, request.seed)
    began_s = time.monotonic()
    if output is None or request.estimate:
        out.print(
            f"{request.world.scene}: {estimate(bake_of(scene, settings), request.jobs)}",
            markup=False,
        )
        return
    baked = bake_scene(
        scene, output, settings, request.jobs, _progress, request.force,
        lambda bake: print_note(estimate(bake, request.jobs)),
    )  # fmt: skip
    if baked is None:
        out.print(f"{output}: is baked already: nothing to do", markup=False)
        return
    width, height = baked.atlas_px
    size_mb = sum(path.stat().st_size for path in output.iterdir()) / 1e6
    out.print(
        f"{output}: {width} × {height} texels of {baked.texel_m:g} m, "
        f"{baked.probes} probes, {size_mb:.1f} MB, {time.monotonic() - began_s:.0f} s",
        markup=False,
    )


def _progress(description: str, total: int) -> Callable[[Iterable[int]], Iterable[int]]:
    return lambda steps: track(steps, description, total)
