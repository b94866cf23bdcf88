"""Import of meshes, materials and instances from trimesh scenes, loaded or built in memory.

Colors are sRGB by convention of these formats and are decoded here; only the base color of a
`PBRMaterial` in memory is linear, as in glTF. Triangle winding is unreliable, so meshes are
double-sided unless a `PBRMaterial` in memory says otherwise.
"""

from __future__ import annotations

import io
import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from PIL import Image
from trimesh.visual.material import PBRMaterial, SimpleMaterial

from omnisim.core.errors import SceneError
from omnisim.core.srgb import linear_from_srgb
from omnisim.scene.formats.imported_scene import (
    PLAIN_GRAY,
    ImportedScene,
    Omissions,
    colors_rgba,
    make_mesh,
    material_notices,
    translate,
)
from omnisim.scene.parts import AlphaMode, Instance, Material, Mesh, Texture
from omnisim.scene.textures import TextureStore, alpha_mode_of, rgba8

_OPAQUE_FROM = 0.999
_NO_FILES: Mapping[str, bytes] = {}
_ALPHA_MODES = {"OPAQUE": AlphaMode.OPAQUE, "MASK": AlphaMode.MASK, "BLEND": AlphaMode.BLEND}
_DEFAULT_DIFFUSE = (102, 102, 102, 255)  # diffuse color of a SimpleMaterial without one


def read_trimesh(source: object, name: str, smooth: bool | None) -> tuple[ImportedScene, float]:
    """Import a trimesh scene or mesh built in memory, with its unit in meters.

    Raises:
        SceneError: another type, no geometry or an unknown unit.
    """
    if isinstance(source, trimesh.Trimesh):
        scene = trimesh.Scene()
        scene.add_geometry(source, node_name=name, geom_name=name)
    elif isinstance(source, trimesh.Scene):
        scene = source
    else:
        raise SceneError(
            f"{name}: expected a trimesh.Scene or trimesh.Trimesh, got {type(source).__name__}"
        )
    textures = TextureStore()
    read = import_trimesh(scene, textures, None, smooth)
    if not read.instances:
        raise SceneError(f"{name}: has no triangles to draw")
    notices = [
        f"{name}: {notice}"
        for notice in (*textures.notices, *material_notices(read), *read.notices)
    ]
    return read._replace(notices=list(dict.fromkeys(notices))), _meters_per_unit(source.units)


def _meters_per_unit(units: str | None) -> float:
    if units is None:
        return 1.0
    try:
        return float(trimesh.units.unit_conversion(units, "meters"))
    except (KeyError, ValueError):
        raise SceneError(f"units: expected those of a length, got {units!r}") from None


def import_trimesh(
    loaded: trimesh.Scene,
    textures: TextureStore,
    assets: Mapping[str, bytes] | None = None,
    smooth: bool | None = None,
    objects: Sequence[str] = (),
) -> ImportedScene:
    """Import the meshes of a trimesh scene.

    Args:
        loaded: trimesh scene.
        textures: store that decodes the scene's images.
        assets: files referenced by the scene file; None: built in memory.
        smooth: True: vertex normals; False: flat shading; None: vertex normals if present.
        objects: names of the objects by number, for geometries named `:number`.
    """
    dropped = Omissions()
    meshes: list[Mesh] = []
    materials: list[Material] = []
    notices: list[str] = []
    index_of: dict[str, tuple[int, NDArray[np.float64]]] = {}
    for name, geometry in loaded.geometry.items():
        if not isinstance(geometry, trimesh.Trimesh):
            notices.append("points and lines are not drawn")
        elif len(geometry.faces):
            mesh, center = _mesh(_object(name, objects), geometry, len(materials), smooth, dropped)
            index_of[name] = (len(meshes), center)
            meshes.append(mesh)
            if assets is None:
                materials.append(_material_in_memory(name, geometry.visual, textures, notices))
            else:
                own = _object(name, objects)
                materials.append(_material_of_file(own, geometry.visual, textures, assets))
    instances = []
    for node in loaded.graph.nodes_geometry:
        file_from_mesh, geometry_name = loaded.graph[node]
        if geometry_name in index_of:
            index, center = index_of[geometry_name]
            pose = translate(file_from_mesh, center)
            instances.append(Instance(_object(node, objects), index, pose, file_from_mesh))
    notices += dropped.notices
    return ImportedScene(tuple(meshes), tuple(materials), tuple(instances), notices)


def _object(geometry: object, objects: Sequence[str]) -> str:
    """Name of a geometry's object: its own, or by its number, as in `:3_wood`."""
    number = re.match(r":(\d+)", str(geometry))
    return objects[int(number[1])] if number and objects else str(geometry)


def _mesh(
    name: str, geometry: trimesh.Trimesh, material: int, smooth: bool | None, dropped: Omissions
) -> tuple[Mesh, NDArray[np.float64]]:
    visual = geometry.visual
    positions: NDArray[np.float64] = np.asarray(geometry.vertices)
    if positions.shape[1] != 3:  # from an OBJ file with a damaged vertex
        raise SceneError(f"mesh {name!r}: expected vertices of three numbers")
    triangles: NDArray[np.int64] = np.asarray(geometry.faces)
    normals = geometry._cache.cache.get("vertex_normals")  # present if the file has them
    if smooth is not None:
        normals = np.array(geometry.vertex_normals) if smooth else None
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
        # one color per triangle requires separate vertices
        colors = np.repeat(_linear_colors(visual.face_colors), 3, axis=0)
        positions, normals = positions[triangles].reshape(-1, 3), None
        triangles = np.arange(len(positions)).reshape(-1, 3)
    return make_mesh(
        name, positions, triangles, material, normals, coordinates, colors, None, dropped
    )


@np.errstate(over="ignore", invalid="ignore")  # non-finite coordinates are dropped with the mesh
def _texture_coordinates(visual: trimesh.visual.TextureVisuals) -> NDArray[np.float64]:
    """Texture coordinates (n, 2) with v down, after MTL's scale and offset of the map."""
    extra = getattr(visual.material, "kwargs", {})
    coordinates = np.array(visual.uv, dtype=np.float64)[:, :2]
    coordinates *= _pair(extra, "s", 1.0)
    coordinates += _pair(extra, "o", 0.0)
    coordinates[:, 1] = 1.0 - coordinates[:, 1]
    return coordinates


def _pair(extra: Mapping[str, Sequence[str]], option: str, default: float) -> list[float]:
    """First two numbers of an option of MTL's color map."""
    words = extra.get(f"map_kd-{option}") or ()
    try:
        return ([float(word) for word in words] + [default, default])[:2]
    except ValueError:
        raise SceneError(
            f"map_Kd -{option} = {' '.join(words)}: expected up to three numbers"
        ) from None


def _material_of_file(
    mesh_name: str, visual: Any, textures: TextureStore, assets: Mapping[str, bytes]
) -> Material:
    """Material of a mesh loaded from a file."""
    if not isinstance(visual, trimesh.visual.TextureVisuals):
        return _untextured(mesh_name, visual)
    source = visual.material
    image, factor = getattr(source, "image", None), getattr(source, "diffuse", None)
    if isinstance(source, PBRMaterial):
        image, factor = source.baseColorTexture, source.baseColorFactor
    elif "kd" not in getattr(source, "kwargs", {}):
        factor = None  # trimesh's placeholder for a missing Kd
    if getattr(image, "format", None) is None:
        image = None  # trimesh's placeholder for a missing material, not an image from a file
    return _material(mesh_name, source, image, factor, textures, assets)


def _material_in_memory(
    mesh_name: str, visual: Any, textures: TextureStore, notices: list[str]
) -> Material:
    """Material of a mesh built in memory."""
    if not isinstance(visual, trimesh.visual.TextureVisuals):
        return _untextured(mesh_name, visual)
    source = visual.material
    if isinstance(source, PBRMaterial):
        return _pbr_material(mesh_name, source, textures)
    image, factor = getattr(source, "image", None), getattr(source, "diffuse", None)
    if isinstance(source, SimpleMaterial):
        if source.kwargs.get("map_d"):
            notices.append(f"map_d of {source.name or mesh_name!r} is not there: drawn without it")
        if image is not None and tuple(source.diffuse) == _DEFAULT_DIFFUSE:
            factor = None
    return _material(mesh_name, source, image, factor, textures, _NO_FILES)


def _untextured(mesh_name: str, visual: Any) -> Material:
    gray = 1.0 if visual.kind in ("vertex", "face") else PLAIN_GRAY
    return Material(mesh_name, (gray, gray, gray, 1.0), double_sided=True)


def _pbr_material(mesh_name: str, source: PBRMaterial, textures: TextureStore) -> Material:
    """Material interpreted as in glTF."""
    name = str(source.name or mesh_name)
    image, factor = source.baseColorTexture, source.baseColorFactor
    texture = None if image is None else textures.texture(image, name)
    rgba = np.ones(4) if factor is None else np.resize(np.array(factor) / 255.0, 4)
    red, green, blue, alpha = (float(value) for value in rgba)
    return Material(
        name,
        (red, green, blue, alpha),
        texture,
        _ALPHA_MODES.get(str(source.alphaMode).upper(), AlphaMode.OPAQUE),
        alpha_cutoff=0.5 if source.alphaCutoff is None else float(source.alphaCutoff),
        double_sided=bool(source.doubleSided),
    )


def _material(
    mesh_name: str,
    source: Any,
    image: Image.Image | None,
    factor: Sequence[float] | NDArray[np.uint8] | None,
    textures: TextureStore,
    assets: Mapping[str, bytes],
) -> Material:
    """Material from an image and a factor (3 or 4), both sRGB, and from MTL's options."""
    name = str(getattr(source, "name", None) or mesh_name)
    extra = getattr(source, "kwargs", {})
    texture = None if image is None else textures.texture(image, name)
    hole_map = _hole_map(extra, assets)
    if hole_map is not None:
        white = Texture(np.full((*hole_map.shape, 4), 255, dtype=np.uint8))
        texture = _with_alpha(texture or white, hole_map)
    if factor is None:
        factor = [255] * 4 if texture is not None else [204, 204, 204, 255]
    rgba = np.resize(np.array(factor, dtype=np.float64) / 255.0, 4)
    if image is not None and not rgba[:3].any():
        rgba[:3] = 1.0  # exporters write a black Kd with map_Kd, but mean the map alone
    alpha = _opacity(extra, float(rgba[3]))
    mode = alpha_mode_of(texture) if alpha >= _OPAQUE_FROM else AlphaMode.BLEND
    red, green, blue = (float(value) for value in linear_from_srgb(rgba[:3]))
    return Material(name, (red, green, blue, alpha), texture, mode, double_sided=True)


def _linear_colors(colors: NDArray[np.uint8]) -> NDArray[np.float32]:
    rgba = colors_rgba(colors, 255.0)
    rgba[:, :3] = linear_from_srgb(rgba[:, :3])
    return rgba


def _opacity(extra: dict[str, Any], default: float) -> float:
    """Opacity from MTL's `d`, or its complement `Tr`; non-numeric values are ignored."""
    try:
        if "d" in extra:
            return _share(float(extra["d"][-1]))
        if "tr" in extra:
            return _share(1.0 - float(extra["tr"][-1]))
    except (TypeError, ValueError, IndexError):
        return default
    # COLLADA files encode transparency inconsistently; a fully invisible surface is a mistake
    return default if default > 0.0 else 1.0


def _share(value: float) -> float:
    return min(max(value, 0.0), 1.0) if math.isfinite(value) else 1.0


def _hole_map(extra: dict[str, Any], assets: Mapping[str, bytes]) -> NDArray[np.uint8] | None:
    """Opacity levels (height, width) uint8 from MTL's `map_d`; None: no usable map."""
    if not extra.get("map_d"):
        return None
    try:
        pixels = rgba8(Image.open(io.BytesIO(assets[" ".join(extra["map_d"])])))
    except Exception:  # a missing file is reported already; Pillow raises exceptions of any type
        return None
    holes = pixels[..., 3]
    return holes if (holes < 255).any() else pixels[..., 0]


def _with_alpha(texture: Texture, levels: NDArray[np.uint8]) -> Texture:
    """Texture with `levels` as its alpha, sampled at the nearest level."""
    height, width = texture.pixels.shape[:2]
    rows = np.arange(height) * levels.shape[0] // height
    columns = np.arange(width) * levels.shape[1] // width
    pixels = texture.pixels.copy()
    pixels[..., 3] = levels[rows[:, None], columns]
    return Texture(pixels, texture.wrap_u, texture.wrap_v)
