"""Folder of a bake: lightmap, unwrapping, probes, and the fingerprint of the scene."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import AnyFloats, Bools, Floats32, Ints32
from omnisim.core.errors import OutputError
from omnisim.core.extras import require_extra
from omnisim.core.files.atomic_file import atomic_folder, check_new_folder
from omnisim.core.files.image_files import write_radiance
from omnisim.core.version import __version__
from omnisim.rendering.baking.bake import (
    Arrays,
    Bake,
    Progress,
    TileFolder,
    no_progress,
    write_arrays,
)
from omnisim.rendering.baking.lightmap_atlas import Unwrapping
from omnisim.rendering.baking.patches import NEIGHBORS, Patches
from omnisim.rendering.baking.settings import BakeSettings
from omnisim.scene.light.baked import without_even_light
from omnisim.scene.model import Scene

VERSION = 1
_UV_STEPS = np.float32(1 << 16)


class BakeSizes(NamedTuple):
    """Sizes of a bake."""

    atlas_px: tuple[int, int]  # width and height
    texel_m: float  # width of a texel near the vehicles
    probes: int  # number of valid probes


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
    fingerprint = scene.identity.light
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
        for name in FILES:  # makes room for the new ones
            (output / name).unlink(missing_ok=True)
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


def _short(indices: Ints32) -> NDArray[np.unsignedinteger[Any]]:
    """Indices in the smallest integer type that holds them."""
    return indices.astype(np.uint16 if indices.max(initial=0) <= 0xFFFF else np.uint32)


# Output folders of bakes: new or empty, with the same finished bake, or with another.
FILES = ("baked.json", "irradiance.exr", "probes.npz", "unwrapping.npz")
_SETTINGS = ("samples", "bounces", "seed")  # and the width of texels, if it is given


def is_finished(
    output: Path, fingerprint: str, settings: BakeSettings, force: bool = False
) -> bool:
    """True if a folder holds exactly this bake; False if it has to be written.

    Args:
        output: folder of the bake.
        fingerprint: fingerprint of the scene.
        settings: settings of the bake.
        force: allow another bake in the folder, which is overwritten.

    Raises:
        OutputError: the folder holds another bake or other files, or cannot be written.
    """
    names = sorted(path.name for path in output.iterdir()) if output.is_dir() else []
    if not names:
        if not output.is_dir():
            check_new_folder(output)
        return False
    if not set(names) <= set(FILES):
        raise OutputError(f"{output}: is not a bake: expected a new or empty folder")
    document = _document(output)
    if document.get("fingerprint") != fingerprint:
        what = "of another scene, or of this scene before it changed"
    elif (
        len(names) < len(FILES)
        or settings.texel_m not in (None, document.get("texel_m"))
        or any(document.get(setting) != getattr(settings, setting) for setting in _SETTINGS)
    ):
        what = "with other settings"
    else:
        return not force
    if not force:
        raise OutputError(f"{output}: is a bake {what}: pass --force to overwrite it")
    return False


def _document(output: Path) -> Mapping[str, Any]:
    try:
        document = json.loads((output / FILES[0]).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return document if isinstance(document, dict) else {}


# Lightmap: light of the patches as atlas pixels, filling the rectangles of the charts.
_MAX_STEPS = 24  # in texels; deeper texels are inside of something and invisible


def lightmap(patches: Patches, light: Floats32, is_valid: Bools) -> Floats32:
    """Pixels (height, width, 3): light (p, 3) of the patches in the atlas.

    Texels without light, and those around a chart in its rectangle, take the light of their
    neighbors, so that interpolation between texels is right.
    """
    width, height = patches.size_px
    used = np.flatnonzero(is_valid & (patches.places < width * height))
    places = patches.atlas_places[used]
    counts = np.bincount(places, minlength=width * height).astype(np.float32)
    pixels = np.stack(
        [
            np.bincount(places, weights=light[used, channel], minlength=width * height)
            for channel in range(3)
        ],
        axis=1,
    ).astype(np.float32)
    pixels /= np.maximum(counts, 1.0)[:, None]
    known = (counts > 0.0).reshape(height, width)
    pixels, charts = pixels.reshape(height, width, 3), patches.charts
    for _ in range(_MAX_STEPS):
        sums, counts = np.zeros_like(pixels), np.zeros(known.shape, dtype=np.float32)
        for to, of in NEIGHBORS:
            some = known[of] & (charts[to] == charts[of])
            sums[to] += np.where(some[..., None], pixels[of], 0.0)
            counts[to] += some
        filled = ~known & (counts > 0.0)
        if not filled.any():
            break
        pixels[filled] = sums[filled] / counts[filled][:, None]
        known = known | filled
    return pixels


# Rounding of light before storage: fewer digits make smaller files.


# Bits kept of the largest value of a texel or probe, in half floats: the error is at most 1/256,
# which is less than half an 8-bit step of a bright pixel.
_BITS = 7
_MIN_HALF, _MAX_HALF = 1e-6, 65504.0


def rounded_halves(values: AnyFloats, axes: int | tuple[int, ...]) -> NDArray[np.float16]:
    """Round light to steps set by the largest value along axes, as in shared-exponent colors."""
    largest = np.abs(values).max(axis=axes, keepdims=True)
    steps = 2.0 ** (np.floor(np.log2(np.maximum(largest, _MIN_HALF))) - _BITS)
    return np.clip(np.round(values / steps) * steps, -_MAX_HALF, _MAX_HALF).astype(np.float16)
