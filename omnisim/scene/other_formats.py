"""OBJ, PLY, STL, COLLADA and all other formats that trimesh reads, with simpler materials.

Their colours are display values (sRGB), by the custom of these formats, and are decoded here.
None of them says which side of a triangle is its front reliably, so both are drawn.
"""

from __future__ import annotations

import io
import logging
import math
import warnings
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from PIL import Image

from omnisim.errors import SceneError
from omnisim.extras import require_extra
from omnisim.scene.asset_resolver import AssetResolver
from omnisim.scene.imported import ImportedScene, colors_rgba, make_mesh, translate
from omnisim.scene.mesh_faults import mesh_fault
from omnisim.scene.obj_text import MATERIAL_FILES, plain_mtl, plain_obj
from omnisim.scene.parts import AlphaMode, Instance, Material, Mesh, Texture
from omnisim.scene.textures import TextureStore, alpha_mode_of, rgba8
from omnisim.srgb import linear_from_srgb

# A surface without any colour: a light grey of 80 % on the screen.
PLAIN_GREY = float(linear_from_srgb(0.8))
_OPAQUE_FROM = 0.999
_COLLADA = {".dae", ".zae"}
# trimesh also reads paths without surfaces, voxels, and archives of files.
_NOT_SCENES = {"dxf", "svg", "binvox", "zip", "tar.gz", "tar.bz2", "tgz", "bz2", "gz"}
# What it would write to standard error is said by errors and notices.
logging.getLogger("trimesh").addHandler(logging.NullHandler())


def check_format(path: Path) -> None:
    """Check that trimesh reads surfaces from files with the suffix of `path`."""
    if path.suffix.lower() in _COLLADA:
        require_extra("collada", str(path), SceneError)
    if path.suffix.lower()[1:] not in set(trimesh.available_formats()) - _NOT_SCENES:
        raise SceneError(
            f"{path}: unknown scene format: expected .glb .gltf .obj .ply .stl .dae, or a scene's "
            f".toml, got {path.suffix or '(no suffix)'!r}"
        )


def read_other(
    path: Path, data: bytes, textures: TextureStore, assets: AssetResolver
) -> ImportedScene:
    """Read a file of any format but glTF."""
    plain = None
    if path.suffix.lower() == ".obj":
        plain, names = plain_obj(data)
        assets.given[MATERIAL_FILES] = _material_files(names, assets)
    loaded = _load_with_trimesh(path, data, plain, assets)
    meshes: list[Mesh] = []
    materials: list[Material] = []
    notices: list[str] = []
    index_of: dict[str, tuple[int, NDArray[np.float64]]] = {}
    for name, geometry in loaded.geometry.items():
        if not isinstance(geometry, trimesh.Trimesh):
            notices.append("points and lines are not drawn")
        elif len(geometry.faces):
            mesh, center = _mesh(name, geometry, len(materials))
            index_of[name] = (len(meshes), center)
            meshes.append(mesh)
            materials.append(_material(name, geometry.visual, textures, assets))
    instances = []
    for node in loaded.graph.nodes_geometry:
        file_from_mesh, geometry_name = loaded.graph[node]
        if geometry_name in index_of:
            index, center = index_of[geometry_name]
            instances.append(Instance(str(node), index, translate(file_from_mesh, center)))
    return ImportedScene(tuple(meshes), tuple(materials), tuple(instances), notices)


def _load_with_trimesh(
    path: Path, data: bytes, plain: bytes | None, assets: AssetResolver
) -> trimesh.Scene:
    """Load a file, or the plain form that is read in its place."""
    kind = path.suffix[1:].lower()
    try:
        # without NumPy's warnings of a damaged file, and Pillow's of a large picture
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            file = io.BytesIO(data if plain is None else plain)
            return trimesh.load_scene(file, file_type=kind, resolver=assets, process=False)
    except MemoryError:
        raise
    except Exception as reason:  # a damaged file can make trimesh's readers fail in any way
        if isinstance(reason, ImportError) and reason.name != "charset_normalizer":
            message = f"it needs {reason.name}: pip install {reason.name}"
        else:  # trimesh guesses encodings with charset_normalizer
            message = mesh_fault(kind, data)
        missing = f"{assets.missing[-1]} is not there; " if assets.missing else ""
        raise SceneError(f"cannot be read as {kind}: {missing}{message}") from None


def _material_files(names: list[str], assets: AssetResolver) -> bytes:
    """All material files that an OBJ's `mtllib` lines name, as one."""
    parts = []
    for line in names:
        # "a.mtl b.mtl" is two files, "my file.mtl" is one
        for name in [line] if line in assets else line.split():
            with suppress(FileNotFoundError):
                parts.append(plain_mtl(assets[name]))
    return b"\n".join(parts)


def _mesh(name: str, geometry: trimesh.Trimesh, material: int) -> tuple[Mesh, NDArray[np.float64]]:
    visual = geometry.visual
    positions: NDArray[np.float64] = np.asarray(geometry.vertices)
    if positions.shape[1] != 3:  # of an OBJ file with a damaged vertex
        raise SceneError(f"mesh {name!r}: expected vertices of three numbers")
    triangles: NDArray[np.int64] = np.asarray(geometry.faces)
    normals = geometry._cache.cache.get("vertex_normals")  # present where the file has them
    coordinates = colors = None
    if isinstance(visual, trimesh.visual.TextureVisuals):
        if (
            visual.uv is not None
            and len(visual.uv) == len(positions)
            and visual.uv.shape[1:] >= (2,)
        ):
            coordinates = _texture_coordinates(visual)
    elif visual is not None and visual.kind == "vertex":
        colors = _linear_colors(visual.vertex_colors)
    elif visual is not None and visual.kind == "face":
        # one colour a triangle: each gets vertices of its own
        colors = np.repeat(_linear_colors(visual.face_colors), 3, axis=0)
        positions, normals = positions[triangles].reshape(-1, 3), None
        triangles = np.arange(len(positions)).reshape(-1, 3)
    return make_mesh(name, positions, triangles, material, normals, coordinates, colors)


def _texture_coordinates(visual: trimesh.visual.TextureVisuals) -> NDArray[np.float64]:
    """Texture coordinates (n, 2), v down; MTL's scale and offset of the map applied."""
    extra = getattr(visual.material, "kwargs", {})
    coordinates = np.array(visual.uv, dtype=np.float64)[:, :2]
    coordinates *= _pair(extra.get("map_kd-s"), 1.0)
    coordinates += _pair(extra.get("map_kd-o"), 0.0)
    coordinates[:, 1] = 1.0 - coordinates[:, 1]
    return coordinates


def _pair(words: Sequence[str] | None, default: float) -> list[float]:
    """The first two numbers of a texture map's option."""
    return ([float(word) for word in words or ()] + [default, default])[:2]


def _material(
    mesh_name: str, visual: Any, textures: TextureStore, assets: AssetResolver
) -> Material:
    if not isinstance(visual, trimesh.visual.TextureVisuals):
        grey = 1.0 if visual.kind in ("vertex", "face") else PLAIN_GREY
        return Material(mesh_name, (grey, grey, grey, 1.0), double_sided=True)
    source = visual.material
    name = str(getattr(source, "name", None) or mesh_name)
    image, factor = getattr(source, "image", None), getattr(source, "diffuse", None)
    extra = getattr(source, "kwargs", {})
    if isinstance(source, trimesh.visual.material.PBRMaterial):
        image, factor = source.baseColorTexture, source.baseColorFactor
    elif "kd" not in extra:
        factor = None  # trimesh's stand-in for a missing Kd
    if getattr(image, "format", None) is None:
        image = None  # trimesh's stand-in for a missing material, not a picture from a file
    texture = None if image is None else textures.texture(image, name)
    hole_map = _hole_map(extra, assets)
    if hole_map is not None:
        white = Texture(np.full((*hole_map.shape, 4), 255, dtype=np.uint8))
        texture = _with_alpha(texture or white, hole_map)
    if factor is None:
        factor = [255] * 4 if texture is not None else [204, 204, 204, 255]
    rgba = np.resize(np.array(factor, dtype=np.float64) / 255.0, 4)
    if image is not None and not rgba[:3].any():
        rgba[:3] = 1.0  # exporters write a black Kd beside map_Kd, and mean the map
    alpha = _opacity(extra, float(rgba[3]))
    mode = alpha_mode_of(texture) if alpha >= _OPAQUE_FROM else AlphaMode.BLEND
    red, green, blue = (float(value) for value in linear_from_srgb(rgba[:3]))
    return Material(name, (red, green, blue, alpha), texture, mode, double_sided=True)


def _linear_colors(colors: NDArray[np.uint8]) -> NDArray[np.float32]:
    rgba = colors_rgba(colors, 255.0)
    rgba[:, :3] = linear_from_srgb(rgba[:, :3])
    return rgba


def _opacity(extra: dict[str, Any], default: float) -> float:
    """MTL's `d`, or its opposite `Tr`; a word where a number belongs is as if not written."""
    try:
        if "d" in extra:
            return _share(float(extra["d"][-1]))
        if "tr" in extra:
            return _share(1.0 - float(extra["tr"][-1]))
    except (TypeError, ValueError, IndexError):
        return default
    # COLLADA's ways to state transparency contradict each other; invisible surfaces are mistakes
    return default if default > 0.0 else 1.0


def _share(value: float) -> float:
    return min(max(value, 0.0), 1.0) if math.isfinite(value) else 1.0


def _hole_map(extra: dict[str, Any], assets: AssetResolver) -> NDArray[np.uint8] | None:
    """MTL's `map_d` as levels (height, width) uint8."""
    if not extra.get("map_d"):
        return None
    try:
        pixels = rgba8(Image.open(io.BytesIO(assets[" ".join(extra["map_d"])])))
    except Exception:  # missing: the resolver has noted its name; Pillow's readers raise all kinds
        return None
    holes = pixels[..., 3]
    return holes if (holes < 255).any() else pixels[..., 0]


def _with_alpha(texture: Texture, levels: NDArray[np.uint8]) -> Texture:
    """The texture with `levels` as its alpha, each texel taking the nearest level."""
    height, width = texture.pixels.shape[:2]
    rows = np.arange(height) * levels.shape[0] // height
    columns = np.arange(width) * levels.shape[1] // width
    pixels = texture.pixels.copy()
    pixels[..., 3] = levels[rows[:, None], columns]
    return Texture(pixels, texture.wrap_u, texture.wrap_v)
