"""Folder of a bake: lightmap, unwrapping, probes, and the fingerprint of the scene."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.core.extras import require_extra
from omnisim.core.files.atomic_file import atomic_folder
from omnisim.core.files.image_files import write_radiance
from omnisim.core.version import __version__
from omnisim.rendering.baking.atlas.bake_tiles import (
    Arrays,
    Progress,
    TileFolder,
    no_progress,
    write_arrays,
)
from omnisim.rendering.baking.atlas.lightmap import lightmap
from omnisim.rendering.baking.atlas.unwrapping import Unwrapping
from omnisim.rendering.baking.bake import Bake
from omnisim.rendering.baking.rounding import rounded_halves
from omnisim.rendering.baking.settings import BakeSettings
from omnisim.rendering.baking.targets import clear, is_finished
from omnisim.scene.light.baked_fingerprint import baked_fingerprint
from omnisim.scene.light.emissive_light import without_even_light
from omnisim.scene.model import Scene

VERSION = 1
_UV_STEPS = np.float32(1 << 16)


class BakeSizes(NamedTuple):
    """Sizes of a bake.

    Attributes:
        atlas_px: width and height.
        texel_m: width of a texel near the vehicles.
        probes: number of valid probes.
    """

    atlas_px: tuple[int, int]
    texel_m: float
    probes: int


def bake_scene(
    scene: Scene,
    output: Path,
    settings: BakeSettings,
    jobs: int | None = None,
    progress: Progress = no_progress,
    force: bool = False,
    start: Callable[[Bake], None] = lambda bake: None,
) -> BakeSizes | None:
    """Bake the light of a scene's static surfaces into a folder; None: already baked.

    Unfinished work stays in a folder beside it; the same bake resumes it, on any machine.

    Args:
        scene: scene to bake; its dynamic objects are ignored.
        output: folder of the bake.
        settings: settings of the bake.
        jobs: number of threads; None: one per core. The files do not depend on it.
        progress: progress display of each stage.
        force: overwrite another bake.
        start: callback before the light is computed.

    Raises:
        OmnisimError: the folder holds another bake, a package is missing, texels are too small, or
            a file cannot be written.
    """
    require_extra("bake", "baking light")
    fingerprint = baked_fingerprint(scene)
    if is_finished(output, fingerprint, settings, force):
        return None
    bake = bake_of(scene, settings)
    plan = {
        "omnisim": __version__,
        "fingerprint": fingerprint,
        "texel_m": settings.texel_m,  # as given: a computed width may round differently elsewhere
        "atlas_px": list(bake.atlas.size_px),
        "samples": settings.samples,
        "bounces": settings.bounces,
        "seed": settings.seed,
    }
    start(bake)
    folder = TileFolder(output, plan)
    baked = bake.run(folder, jobs, progress)
    grid, probes = bake.probes(folder, baked, jobs, progress)
    pixels = lightmap(bake.patches, bake.light(baked), baked.is_valid)
    document = plan | {
        "version": VERSION,
        "texel_m": bake.texel_m,
        "exposure": scene.lighting.exposure,
        "rects": bake.atlas.shares(bake.atlas.rects_px),
        "back_rects": bake.atlas.shares(bake.atlas.back_rects_px),
        "probes": {
            "origin_m": grid.origin_m.tolist(),
            "spacing_m": grid.spacing_m.tolist(),
            "shape": list(grid.shape),
        },
    }
    with atomic_folder(output) as partial:
        write_radiance(partial / "irradiance.exr", rounded_halves(np.maximum(pixels, 0.0), -1))
        with (partial / "probes.npz").open("wb") as file:
            stored = probes | {"sh": rounded_halves(probes["sh"], (-2, -1))}
            write_arrays(file, stored, is_compressed=True)
        with (partial / "unwrapping.npz").open("wb") as file:
            write_arrays(file, _joined(bake.atlas.unwrappings), is_compressed=True)
        text = json.dumps(document, indent=1) + "\n"
        (partial / "baked.json").write_text(text, encoding="utf-8", newline="\n")
        clear(output)
    folder.remove()
    return BakeSizes(bake.atlas.size_px, bake.texel_m, int(probes["valid"].sum()))


def bake_of(scene: Scene, settings: BakeSettings) -> Bake:
    """Bake of a scene, before its light is computed.

    Raises:
        OmnisimError: a package is missing, or texels are too small.
    """
    return Bake(without_even_light(scene), settings)


def _joined(unwrappings: dict[int, Unwrapping]) -> Arrays:
    """Arrays of all meshes, concatenated: few arrays make a small archive that loads fast."""
    numbers = sorted(unwrappings)
    pages = [unwrappings[mesh] for mesh in numbers]
    counts = [
        (mesh, len(unwrappings[mesh].vertex_of), len(unwrappings[mesh].triangles))
        for mesh in numbers
    ]
    nothing = np.empty(0, np.int32)
    vertex_of = np.concatenate([nothing, *(page.vertex_of for page in pages)])
    triangles = np.concatenate([nothing.reshape(0, 3), *(page.triangles for page in pages)])
    uv = np.concatenate([np.empty((0, 2), np.float32), *(page.uv for page in pages)])
    return {
        "meshes": np.array(counts, dtype=np.int32).reshape(-1, 3),
        "vertex_of": _short(vertex_of),
        "triangles": _short(triangles),
        "uv": (np.rint(uv * _UV_STEPS) / _UV_STEPS).astype(np.float32),
    }


def _short(indices: NDArray[np.int32]) -> NDArray[np.unsignedinteger[Any]]:
    """Indices in the smallest integer type that holds them."""
    return indices.astype(np.uint16 if indices.max(initial=0) <= 0xFFFF else np.uint32)
