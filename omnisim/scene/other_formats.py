"""OBJ, PLY, STL, COLLADA and whatever else trimesh reads: formats with simpler materials.

Their colours are display values (sRGB), by the custom of these formats, and are decoded here.
None of them says which side of a triangle is its front reliably, so both are drawn.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from omnisim.scene.asset_resolver import AssetResolver
from omnisim.scene.gltf import moved
from omnisim.scene.mesh_data import colors_rgba, make_mesh
from omnisim.scene.model import AlphaMode, Instance, Material, Mesh, Texture
from omnisim.scene.textures import TextureStore, has_holes, rgba8
from omnisim.srgb import linear_from_srgb

# What a surface without any colour looks like: a light grey of 80 % on the screen.
PLAIN_GREY = float(linear_from_srgb(0.8))
_TRANSPARENT_BELOW = 0.999


def read_meshes(
    loaded: trimesh.Scene, textures: TextureStore, resolver: AssetResolver
) -> tuple[tuple[Mesh, ...], tuple[Material, ...], tuple[Instance, ...], list[str]]:
    """Return meshes, materials, instances (world_from_mesh is file_from_mesh) and notices.

    Raises:
        SceneError: damaged vertices or indices.
    """
    meshes: list[Mesh] = []
    materials: list[Material] = []
    notices: list[str] = []
    index_of: dict[str, tuple[int, NDArray[np.float64]]] = {}
    for name, geometry in loaded.geometry.items():
        if not isinstance(geometry, trimesh.Trimesh):
            notices.append(f"{name!r}: points and lines are not drawn")
            continue
        for part in _parts(geometry):
            material, coordinates, colors = _looks(name, part, textures, resolver)
            positions, triangles = part.vertices, part.faces
            normals = part._cache.cache.get("vertex_normals")  # present where the file has them
            if colors is not None and len(colors) == len(triangles) != len(positions):
                # one colour a triangle: each gets vertices of its own
                positions, normals = positions[triangles].reshape(-1, 3), None
                colors = np.repeat(colors, 3, axis=0)
                triangles = np.arange(len(positions)).reshape(-1, 3)
                coordinates = None
            made = make_mesh(
                name, positions, triangles, len(materials), normals, coordinates, colors
            )
            if made is not None:
                index_of[name] = (len(meshes), made[1])
                meshes.append(made[0])
                materials.append(material)
    instances = []
    for node in loaded.graph.nodes_geometry:
        file_from_mesh, geometry_name = loaded.graph[node]
        if geometry_name in index_of:
            mesh, middle = index_of[geometry_name]
            instances.append(Instance(str(node), mesh, moved(file_from_mesh, middle)))
    return tuple(meshes), tuple(materials), tuple(instances), notices


def _parts(geometry: trimesh.Trimesh) -> list[trimesh.Trimesh]:
    return [geometry] if len(geometry.faces) else []


def _looks(
    name: str, mesh: trimesh.Trimesh, textures: TextureStore, resolver: AssetResolver
) -> tuple[Material, NDArray[np.float64] | None, NDArray[np.float32] | None]:
    """Material, texture coordinates (n, 2) with v down, and colours (vertices or triangles, 4)."""
    visual = mesh.visual
    if not isinstance(visual, trimesh.visual.TextureVisuals):
        colors = None
        if visual.kind == "vertex":
            colors = _linear_colors(visual.vertex_colors)
        elif visual.kind == "face":
            colors = _linear_colors(visual.face_colors)
        grey = (PLAIN_GREY,) * 3 if colors is None else (1.0,) * 3
        return Material(name, (*grey, 1.0), double_sided=True), None, colors
    coordinates = None
    if visual.uv is not None and len(visual.uv) == len(mesh.vertices):
        coordinates = np.array(visual.uv, dtype=np.float64)
        coordinates[:, 1] = 1.0 - coordinates[:, 1]
    return _material(name, visual.material, textures, resolver), coordinates, None


def _material(
    mesh_name: str, source: Any, textures: TextureStore, resolver: AssetResolver
) -> Material:
    name = str(getattr(source, "name", None) or mesh_name)
    image = getattr(source, "image", None)
    factor = getattr(source, "diffuse", None)
    if isinstance(source, trimesh.visual.material.PBRMaterial):
        image, factor = source.baseColorTexture, source.baseColorFactor
    texture = None if image is None else textures.texture(image, name)
    extra = getattr(source, "kwargs", {})
    hole_map = _hole_map(extra, resolver)
    if texture is not None and hole_map is not None:
        texture = _with_alpha(texture, hole_map)
    rgba = np.array([204, 204, 204, 255] if factor is None else factor, dtype=np.float64) / 255.0
    if image is not None and not rgba[:3].any():
        rgba[:3] = 1.0  # exporters write a black Kd beside map_Kd, and mean the map
    alpha = _opacity(extra, float(rgba[3]))
    mode = AlphaMode.OPAQUE
    if has_holes(texture):
        mode = AlphaMode.MASK
    if alpha < _TRANSPARENT_BELOW:
        mode = AlphaMode.BLEND
    red, green, blue = (float(value) for value in linear_from_srgb(rgba[:3]))
    return Material(name, (red, green, blue, alpha), texture, mode, double_sided=True)


def _linear_colors(colors: NDArray[np.uint8]) -> NDArray[np.float32]:
    rgba = colors_rgba(colors, 255.0)
    rgba[:, :3] = linear_from_srgb(rgba[:, :3])
    return rgba


def _opacity(extra: dict[str, Any], default: float) -> float:
    """MTL's `d`, or its opposite `Tr`."""
    try:
        if "d" in extra:
            return float(extra["d"][-1])
        if "tr" in extra:
            return 1.0 - float(extra["tr"][-1])
    except (TypeError, ValueError, IndexError):
        pass  # a word where a number belongs: as if it were not written
    return default


def _hole_map(extra: dict[str, Any], resolver: AssetResolver) -> NDArray[np.uint8] | None:
    """MTL's `map_d` as levels (height, width) uint8."""
    import io

    from PIL import Image

    if not extra.get("map_d"):
        return None
    try:
        pixels = rgba8(Image.open(io.BytesIO(resolver.get(" ".join(extra["map_d"])))))
    except (OSError, ValueError, SyntaxError):  # missing: the resolver has noted its name
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
