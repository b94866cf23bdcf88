"""Loads a scene, from a file or by the name of a built-in one, into the world frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omnisim.errors import SceneError, printable
from omnisim.scene.asset_resolver import AssetResolver
from omnisim.scene.file_axes import world_from_file
from omnisim.scene.gltf.reader import read_gltf
from omnisim.scene.imported import place
from omnisim.scene.labels import label_rules
from omnisim.scene.lighting import DEFAULT_BACKGROUND, expose
from omnisim.scene.model import (
    MAX_LIGHTS,
    ColorBand,
    Landmark,
    NamedStart,
    Scene,
    ScenePath,
    StartPose,
    bounds_m,
)
from omnisim.scene.scene_file import SceneFile
from omnisim.scene.source import resolve_source
from omnisim.scene.start import default_start
from omnisim.scene.textures import TextureStore

_GLTF = {".glb", ".gltf"}
MAX_NOTICE = 300


def load_scene(source: str | Path, up_axis: str | None = None) -> Scene:
    """Load a scene: a mesh file, a scene's TOML, or the name of a built-in scene.

    The world is in metres with z up: a Y-up point (x, y, z) becomes (x, −z, y).

    Args:
        source: path or name.
        up_axis: the file's axis that points up, "x", "y" or "z"; by default its format's
            (glTF and OBJ: y; COLLADA: as it states; others: z).

    Raises:
        SceneError: it is missing, empty, damaged, in an unknown format, or has nothing to draw.
    """
    try:
        path, settings = resolve_source(source)
        if path.suffix.lower() not in _GLTF:
            from omnisim.scene.other_formats import check_format  # with trimesh, slow to import

            check_format(path)
        data = path.read_bytes()
    except OSError as reason:  # no permission, a name too long
        raise SceneError(f"{source}: cannot be read: {reason.strerror}") from None
    if not data:
        raise SceneError(f"{path}: is an empty file")
    try:
        return _load(str(source), path, data, settings, up_axis)
    except SceneError as reason:
        raise SceneError(f"{path}: {reason}") from None
    except MemoryError:
        raise SceneError(f"{path}: asks for more memory than there is") from None


def _load(name: str, path: Path, data: bytes, settings: SceneFile, up_axis: str | None) -> Scene:
    suffix = path.suffix.lower()
    axes = world_from_file(suffix, data, settings, up_axis)
    textures, assets = TextureStore(), AssetResolver(path)
    if suffix in _GLTF:
        read = read_gltf(data, textures, assets, axes)
    else:
        from omnisim.scene.other_formats import read_other  # slow to import

        read = read_other(path, data, textures, assets)
    if not read.instances:
        raise SceneError("has no triangles to draw")
    instances = place(read, axes)
    if len(read.lights) > MAX_LIGHTS:
        read.notices.append(f"has {len(read.lights)} lights: the {MAX_LIGHTS} strongest shine")
    missing = [f"{asset} is not there: drawn without it" for asset in assets.missing]
    notices = [*missing, *textures.notices, *read.notices]
    return Scene(
        name=name,
        meshes=read.meshes,
        materials=read.materials,
        instances=instances,
        lighting=expose(read.lights, read.meshes, instances),
        background=settings.background or DEFAULT_BACKGROUND,
        start=_start(settings, bounds_m(read.meshes, instances)),
        notices=tuple(
            printable(f"{path.name}: {notice}", MAX_NOTICE) for notice in dict.fromkeys(notices)
        ),
        starts=tuple(NamedStart(s.name, s.position_m, s.yaw_deg) for s in settings.starts),
        paths=tuple(ScenePath(p.name, p.waypoints_m, p.start_yaw_deg) for p in settings.paths),
        landmarks=_landmarks(settings),
        labels=label_rules(settings.labels),
    )


def _start(settings: SceneFile, bounds: NDArray[np.float64]) -> StartPose:
    if settings.start is not None:
        return StartPose(settings.start.position_m, settings.start.yaw_deg)
    return default_start(bounds)


def _landmarks(settings: SceneFile) -> tuple[Landmark, ...]:
    """Landmarks with the colours of the palette; each band begins at the top of the one below."""
    landmarks = []
    for table in settings.landmarks:
        bottoms_m = (0.0, *(band.top_m for band in table.bands[:-1]))
        bands = tuple(
            ColorBand(band.color, settings.palette[band.color], bottom_m, band.top_m)
            for bottom_m, band in zip(bottoms_m, table.bands, strict=True)
        )
        landmarks.append(Landmark(table.name, table.position_m, table.footprint_m, bands))
    return tuple(landmarks)
