"""From a file, or the name of a built-in scene, to a scene in our world frame."""

from __future__ import annotations

import difflib
import io
import logging
import re
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import trimesh
from numpy.typing import NDArray

from omnisim.errors import SceneError
from omnisim.scene.asset_resolver import AssetResolver
from omnisim.scene.builtin import builtin_scene_file, builtin_scenes
from omnisim.scene.gltf import GltfReader
from omnisim.scene.gltf_header import check_extensions, marked_file, read_header
from omnisim.scene.model import (
    MAX_LIGHTS,
    Instance,
    Light,
    Material,
    Mesh,
    Scene,
    StartPose,
    bounds_m,
)
from omnisim.scene.other_formats import read_meshes
from omnisim.scene.punctual_lights import default_lighting, lighting_for, read_lights
from omnisim.scene.scene_file import SceneFile, read_scene_file
from omnisim.scene.textures import TextureStore

# A pale clear sky near the horizon, linear RGB.
DEFAULT_BACKGROUND = (0.56, 0.71, 0.87)
# Height of the effective viewpoint above the floor where nobody says: a small robot's.
DEFAULT_HEIGHT_M = 1.0
_WORLD_FROM_UP_AXIS = {
    "x": np.array([[0.0, 0, -1], [0, 1, 0], [1, 0, 0]]),
    "y": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
    "z": np.eye(3),
}
# Where the format itself does not fix it: what Blender's importers assume.
_UP_AXIS_OF_FORMAT = {".glb": "y", ".gltf": "y", ".obj": "y"}
# What trimesh would write to standard error is said in our own words, as errors and notices.
logging.getLogger("trimesh").addHandler(logging.NullHandler())
_NOT_MESHES = {".dxf", ".svg", ".binvox"}


class _Content(NamedTuple):
    """What a mesh file holds, in its own axes and units but for the lights, which are in ours."""

    meshes: tuple[Mesh, ...]
    materials: tuple[Material, ...]
    instances: tuple[Instance, ...]
    notices: list[str]
    lights: tuple[Light, ...] = ()


def load_scene(source: str | Path, up_axis: str | None = None) -> Scene:
    """Load a scene: a mesh file, a scene's TOML, or the name of a built-in scene.

    The world is in metres with z up: a Y-up point (x, y, z) becomes (x, −z, y).

    Args:
        source: path or name.
        up_axis: "x", "y" or "z": the file's axis that points up, where its format's own
            (glTF and OBJ: y; COLLADA: as it says; others: z) is not meant.

    Raises:
        SceneError: it is missing, empty, damaged, in an unknown format, or has nothing to draw.
    """
    path, settings = _locate(source)
    suffix = path.suffix.lower()
    known = {f".{name}" for name in trimesh.available_formats()} - _NOT_MESHES
    if suffix not in known:
        raise SceneError(
            f"{path}: unknown scene format {suffix or '(no suffix)'!r}: want one of "
            ".glb .gltf .obj .ply .stl .dae, or a scene's .toml"
        )
    data = _read(path)
    axis, meters_per_unit = _axis_and_unit(suffix, data, settings, up_axis)
    world_from_file = np.eye(4)
    world_from_file[:3, :3] = _WORLD_FROM_UP_AXIS[axis] * meters_per_unit
    textures, resolver = TextureStore(), AssetResolver(path)
    try:
        if suffix in (".glb", ".gltf"):
            read = _read_gltf(path, data, textures, resolver, world_from_file)
        else:
            loaded = _trimesh(path, data, resolver)
            read = _Content(*read_meshes(loaded, textures, resolver))
    except SceneError as reason:
        raise _named(path, reason) from None
    if not read.instances:
        raise SceneError(f"{path}: has no triangles to draw")
    meshes, lights = read.meshes, read.lights
    instances = tuple(
        Instance(instance.name, instance.mesh, world_from_file @ instance.world_from_mesh)
        for instance in read.instances
    )
    if len(lights) > MAX_LIGHTS:
        read.notices.append(f"has {len(lights)} lamps: the {MAX_LIGHTS} strongest shine")
    missing = [f"{name} is not there: drawn without it" for name in resolver.missing]
    return Scene(
        name=str(source),
        meshes=meshes,
        materials=read.materials,
        instances=instances,
        lighting=lighting_for(lights, meshes, instances) if lights else default_lighting(),
        background=settings.background or DEFAULT_BACKGROUND,
        start=_start(settings, bounds_m(meshes, instances)),
        notices=tuple(
            f"{path.name}: {line}" for line in [*missing, *textures.notices, *read.notices]
        ),
    )


def _locate(source: str | Path) -> tuple[Path, SceneFile]:
    path = Path(source)
    if path.is_dir() and (path / "scene.toml").is_file():
        path = path / "scene.toml"
    builtin = None if path.is_file() else builtin_scene_file(str(source))
    if builtin is not None:
        path = builtin
    if path.is_dir():
        raise SceneError(f"{path}: is a folder without a scene.toml: want a scene file")
    if path.suffix.lower() != ".toml":
        if not path.exists():
            names = builtin_scenes()
            near = difflib.get_close_matches(str(source), names, n=1)
            hint = f"did you mean {near[0]!r}?" if near else "built-in: " + ", ".join(names)
            raise SceneError(f"{source}: no such scene file, and no built-in scene; {hint}")
        return path, SceneFile(file=path.name)
    settings = read_scene_file(path)
    mesh_file = path.parent / settings.file
    if not mesh_file.is_file():
        raise SceneError(f"{path}: file = {settings.file!r}: no such file beside it")
    return mesh_file, settings


def _read(path: Path) -> bytes:
    try:
        data = path.read_bytes()
    except OSError as reason:
        raise SceneError(f"{path}: cannot be read: {reason.strerror}") from None
    if not data:
        raise SceneError(f"{path}: is an empty file")
    return data


def _trimesh(path: Path, data: bytes, resolver: AssetResolver, **options: Any) -> trimesh.Scene:
    try:
        return trimesh.load_scene(
            io.BytesIO(data),
            file_type=path.suffix[1:].lower(),
            resolver=resolver,
            process=False,
            **options,
        )
    except MemoryError:
        raise
    except Exception as reason:  # a damaged file can make trimesh's readers fail in any way
        missing = f"{resolver.missing[-1]} is not there; " if resolver.missing else ""
        words = " ".join(str(reason).split())[:200] or type(reason).__name__
        raise SceneError(f"cannot be read as {path.suffix[1:]}: {missing}{words}") from None


def _read_gltf(
    path: Path,
    data: bytes,
    textures: TextureStore,
    resolver: AssetResolver,
    world_from_file: NDArray[np.float64],
) -> _Content:
    header, rest = read_header(path, data)
    reader = GltfReader(header, textures)
    try:
        check_extensions(path, header)
        loaded = _trimesh(path, marked_file(path, header, rest), resolver)
        meshes, materials, instances = reader.read(loaded)
        lights = read_lights(loaded, header, world_from_file)
    except (KeyError, IndexError, TypeError, ValueError, AttributeError) as reason:
        raise SceneError(f"its JSON does not hold together: {reason!r}") from None
    for key, words in (
        ("animations", "animations are not played"),
        ("skins", "skins are drawn in their rest pose"),
    ):
        if header.get(key):
            reader.notices.append(words)
    if "EXT_mesh_gpu_instancing" in header.get("extensionsUsed", []):
        reader.notices.append("EXT_mesh_gpu_instancing is not read: one of each is drawn")
    return _Content(meshes, materials, instances, reader.notices, lights)


def _named(path: Path, reason: SceneError) -> SceneError:
    words = str(reason)
    return reason if words.startswith(str(path)) else SceneError(f"{path}: {words}")


def _axis_and_unit(
    suffix: str, data: bytes, settings: SceneFile, up_axis: str | None
) -> tuple[str, float]:
    axis, unit = _UP_AXIS_OF_FORMAT.get(suffix, "z"), 1.0
    if suffix == ".dae":  # COLLADA's <asset> says both; trimesh leaves them to us
        found = re.search(rb"<up_axis>\s*([XYZ])_UP\s*</up_axis>", data)
        axis = found[1].decode().lower() if found else "y"
        meter = re.search(rb"<unit\b[^>]*\bmeter\s*=\s*[\"']([-+0-9.eE]+)[\"']", data)
        unit = float(meter[1]) if meter else 1.0
    axis = up_axis or settings.up_axis or axis
    if axis not in _WORLD_FROM_UP_AXIS:
        raise SceneError(f"up axis {axis!r}: want x, y or z")
    return axis, settings.meters_per_unit or unit


def _start(settings: SceneFile, bounds: NDArray[np.float64]) -> StartPose:
    if settings.start is not None:
        return StartPose(settings.start.position_m, settings.start.yaw_deg)
    low, high = bounds
    x, y = 0.5 * (low[:2] + high[:2])
    z = low[2] + min(DEFAULT_HEIGHT_M, 0.5 * (high[2] - low[2]))
    return StartPose((float(x), float(y), float(z)))
