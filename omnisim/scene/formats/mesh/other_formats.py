"""OBJ, PLY, STL, COLLADA and the other formats that trimesh reads, and trimesh's own scenes.

Colors are sRGB by convention of these formats and are decoded here; only the base color of a
`PBRMaterial` in memory is linear, as in glTF. Triangle winding is unreliable, so meshes are
double-sided unless a `PBRMaterial` in memory says otherwise.
"""

from __future__ import annotations

import io
import logging
import math
import re
import shlex
import warnings
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
import trimesh
from PIL import Image
from trimesh.visual.material import PBRMaterial, SimpleMaterial

from omnisim.cameras.mirrors.mirror_mesh import UnfoldedMirrorMesh
from omnisim.core.arrays import Bytes, Floats, Floats32, Ints
from omnisim.core.errors import OutputError, SceneError
from omnisim.core.files.atomic_file import atomic_write, check_target
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
from omnisim.scene.formats.mesh.mesh_contents import (
    MATERIAL_FILES,
    early_end,
    mesh_fault,
    mesh_notices,
    plain_mtl,
    plain_obj,
    points_fault,
    undefined_materials,
)
from omnisim.scene.formats.resources import AssetResolver
from omnisim.scene.parts import AlphaMode, Instance, Material, Mesh, Texture
from omnisim.scene.textures import TextureStore, alpha_mode_of, rgba8, unreadable_image

# Formats that trimesh reads, but not as surfaces: paths, voxels and archives.
_NOT_SCENES = {"dxf", "svg", "binvox", "zip", "tar.gz", "tar.bz2", "tgz", "bz2", "gz"}
_DAMAGED = "is damaged, or not in the format of its suffix"
# Errors and notices replace trimesh's output to standard error.
logging.getLogger("trimesh").addHandler(logging.NullHandler())


def check_format(path: Path) -> None:
    """Check that trimesh reads surfaces from files with the suffix of `path`."""
    if path.suffix.lower()[1:] not in set(trimesh.available_formats()) - _NOT_SCENES:
        conversion = _BY_SUFFIX.get(path.suffix.lower())
        if conversion is not None:
            hint = f"{path}: is not read ({conversion.format}): {conversion.advice}"
            command = f": {conversion.command_for(path)}" if conversion.command else ""
            raise SceneError(hint + command)
        raise SceneError(
            f"{path}: unknown scene format: expected .glb .gltf .obj .ply .stl .dae .sdf "
            f".world .urdf .xml .usd, or a scene's .toml, got {path.suffix or '(no suffix)'!r}"
        )


def read_other(
    path: Path, data: bytes, textures: TextureStore, assets: AssetResolver
) -> ImportedScene:
    """Read a file of any trimesh format.

    Raises:
        SceneError: the file is damaged or has no triangles.
    """
    plain, objects = None, list[str]()
    if path.suffix.lower() == ".obj":
        plain, libraries, objects = plain_obj(data)
        assets.given[MATERIAL_FILES] = _material_files(libraries, assets)
    kind = path.suffix[1:].lower()
    if fault := early_end(kind, data):
        raise SceneError(f"cannot be read as {kind}: {fault}")
    texts = set(assets.read)
    loaded = _load_with_trimesh(kind, data, plain, assets)
    imported = import_trimesh(loaded, textures, assets, objects=objects)
    if not imported.instances and (fault := mesh_fault(kind, data) or points_fault(kind, data)):
        raise SceneError(f"cannot be read as {kind}: {fault}")
    imported.notices.extend(mesh_notices(kind, data))
    if plain is not None:
        imported.notices.extend(mesh_notices("mtl", assets.given[MATERIAL_FILES]))
        imported.notices.extend(undefined_materials(plain, assets.given[MATERIAL_FILES]))
    for name in sorted(assets.read - texts):
        image = b""
        try:
            image = assets[name]
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # about large images
                Image.open(io.BytesIO(image)).close()
        except MemoryError:
            raise
        except Exception:  # Pillow's readers raise exceptions of any type
            assets.faults[name] = unreadable_image(image)
    return imported


def _load_with_trimesh(
    kind: str, data: bytes, plain: bytes | None, assets: AssetResolver
) -> trimesh.Scene:
    try:
        # suppresses NumPy's warnings about damaged files and Pillow's about large images
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            file = io.BytesIO(data if plain is None else plain)
            apart: dict[str, Any] = {"split_objects": True} if plain is not None else {}
            return trimesh.load_scene(file, file_type=kind, resolver=assets, process=False, **apart)
    except MemoryError:
        raise
    except Exception as reason:  # trimesh's readers raise any exception on a damaged file
        if isinstance(reason, ImportError) and reason.name != "charset_normalizer":
            message = f"it needs {reason.name}: pip install {reason.name}"
        else:  # trimesh uses charset_normalizer only to guess encodings
            message = mesh_fault(kind, data) or _DAMAGED
        faults = "".join(f"{name} {fault}; " for name, fault in [*assets.faults.items()][-1:])
        raise SceneError(f"cannot be read as {kind}: {faults}{message}") from None


def _material_files(names: list[str], assets: AssetResolver) -> bytes:
    """Concatenated, normalized material files of an OBJ's `mtllib` lines."""
    parts = []
    for line in names:
        # "a.mtl b.mtl" is two files, "my file.mtl" is one
        for name in [line] if line in assets else line.split():
            with suppress(FileNotFoundError):
                part = plain_mtl(assets[name])
                if b"newmtl" not in part:
                    assets.faults[name] = "has no materials"
                parts.append(part)
    return b"\n".join(parts)


# Import of meshes, materials and instances from trimesh scenes, loaded or built in memory.

_OPAQUE_FROM = 0.999
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
    notices = dict.fromkeys((*textures.notices, *material_notices(read), *read.notices))
    read = read._replace(notices=[f"{name}: {notice}" for notice in notices])
    if source.units is None:
        return read, 1.0
    try:
        return read, float(trimesh.units.unit_conversion(source.units, "meters"))
    except (KeyError, ValueError):
        raise SceneError(f"units: expected a unit of length, got {source.units!r}") from None


def import_trimesh(
    loaded: trimesh.Scene,
    textures: TextureStore,
    assets: Mapping[str, bytes] | None = None,
    smooth: bool | None = None,
    objects: Sequence[str] = (),
) -> ImportedScene:
    """Import the meshes of a trimesh scene.

    Args:
        loaded, textures: trimesh scene, and the store that decodes its images.
        assets: files referenced by the scene file; None: built in memory.
        smooth: True: vertex normals; False: flat shading; None: vertex normals if present.
        objects: names of the objects by number, for geometries named `:number`.
    """
    dropped = Omissions()
    meshes: list[Mesh] = []
    materials: list[Material] = []
    notices: list[str] = []
    index_of: dict[str, tuple[int, Floats]] = {}
    for name, geometry in loaded.geometry.items():
        if not isinstance(geometry, trimesh.Trimesh):
            notices.append("points and lines are not drawn")
        elif len(geometry.faces):
            own, visual = _object(name, objects), cast(Any, geometry.visual)
            mesh, center = _mesh(own, geometry, len(materials), smooth, dropped)
            index_of[name] = (len(meshes), center)
            meshes.append(mesh)
            if not isinstance(visual, trimesh.visual.TextureVisuals):
                gray = 1.0 if visual.kind in ("vertex", "face") else PLAIN_GRAY
                materials.append(Material(own, (gray, gray, gray, 1.0), double_sided=True))
            elif assets is None:
                materials.append(_material_in_memory(own, visual.material, textures, notices))
            else:
                materials.append(_material_of_file(own, visual.material, textures, assets))
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
) -> tuple[Mesh, Floats]:
    visual = geometry.visual
    positions: Floats = np.asarray(geometry.vertices)
    if positions.shape[1] != 3:  # from an OBJ file with a damaged vertex
        raise SceneError(f"mesh {name!r}: expected vertices of three numbers")
    triangles: Ints = np.asarray(geometry.faces)
    normals = geometry._cache.cache.get("vertex_normals")  # present if the file has them
    if smooth is not None:
        normals = np.array(geometry.vertex_normals) if smooth else None
    coordinates = colors = None
    if isinstance(visual, trimesh.visual.TextureVisuals):
        uv = visual.uv
        if uv is not None and len(uv) == len(positions) and uv.shape[1:] >= (2,):
            coordinates = _texture_coordinates(visual)
    elif visual is not None and visual.kind == "vertex":
        colors = _linear_colors(visual.vertex_colors)
    elif visual is not None and visual.kind == "face":
        # one color per triangle requires separate vertices
        colors = np.repeat(_linear_colors(visual.face_colors), 3, axis=0)
        positions, normals = positions[triangles].reshape(-1, 3), None
        triangles = np.arange(len(positions)).reshape(-1, 3)
    return make_mesh(
        name, material, positions, triangles, normals, coordinates, colors, None, dropped
    )


@np.errstate(over="ignore", invalid="ignore")  # non-finite coordinates are dropped with the mesh
def _texture_coordinates(visual: trimesh.visual.TextureVisuals) -> Floats:
    """Texture coordinates (n, 2) with v down, after MTL's scale and offset of the map."""
    extra = getattr(visual.material, "kwargs", {})
    coordinates = np.array(visual.uv, dtype=np.float64)[:, :2]
    coordinates *= _pair(extra, "s", 1.0)
    coordinates += _pair(extra, "o", 0.0)
    coordinates[:, 1] = 1.0 - coordinates[:, 1]
    return coordinates


def _pair(extra: Mapping[str, Sequence[str]], option: str, default: float) -> list[float]:
    words = extra.get(f"map_kd-{option}") or ()
    try:
        return ([float(word) for word in words] + [default, default])[:2]
    except ValueError:
        raise SceneError(
            f"map_Kd -{option} = {' '.join(words)}: expected up to three numbers"
        ) from None


def _material_of_file(
    mesh_name: str, source: Any, textures: TextureStore, assets: Mapping[str, bytes]
) -> Material:
    image, factor = getattr(source, "image", None), getattr(source, "diffuse", None)
    if isinstance(source, PBRMaterial):
        image, factor = source.baseColorTexture, source.baseColorFactor
    elif "kd" not in getattr(source, "kwargs", {}):
        factor = None  # trimesh's placeholder for a missing Kd
    if getattr(image, "format", None) is None:
        image = None  # trimesh's placeholder for a missing material, not an image from a file
    return _material(mesh_name, source, image, factor, textures, assets)


def _material_in_memory(
    mesh_name: str, source: Any, textures: TextureStore, notices: list[str]
) -> Material:
    if isinstance(source, PBRMaterial):
        name = str(source.name or mesh_name)
        image, factor = source.baseColorTexture, source.baseColorFactor
        rgba = np.ones(4) if factor is None else np.resize(np.array(factor) / 255.0, 4)
        red, green, blue, alpha = (float(value) for value in rgba)
        return Material(
            name,
            (red, green, blue, alpha),
            None if image is None else textures.texture(image, name),
            _ALPHA_MODES.get(str(source.alphaMode).upper(), AlphaMode.OPAQUE),
            alpha_cutoff=0.5 if source.alphaCutoff is None else float(source.alphaCutoff),
            double_sided=bool(source.doubleSided),
        )
    image, factor = getattr(source, "image", None), getattr(source, "diffuse", None)
    if isinstance(source, SimpleMaterial):
        if source.kwargs.get("map_d"):
            notices.append(f"map_d of {source.name or mesh_name!r} is missing: drawn without it")
        if image is not None and tuple(source.diffuse) == _DEFAULT_DIFFUSE:
            factor = None
    return _material(mesh_name, source, image, factor, textures, {})


def _material(
    mesh_name: str,
    source: Any,
    image: Image.Image | None,
    factor: Sequence[float] | Bytes | None,
    textures: TextureStore,
    assets: Mapping[str, bytes],
) -> Material:
    """Material from an image and a factor (3 or 4), both sRGB, and from MTL's options."""
    name = str(getattr(source, "name", None) or mesh_name)
    extra = getattr(source, "kwargs", {})
    texture = None if image is None else textures.texture(image, name)
    holes = _hole_map(extra, assets)
    if holes is not None:  # sampled at the nearest level
        texture = texture or Texture(np.full((*holes.shape, 4), 255, dtype=np.uint8))
        height, width = texture.pixels.shape[:2]
        rows = np.arange(height) * holes.shape[0] // height
        columns = np.arange(width) * holes.shape[1] // width
        pixels = texture.pixels.copy()
        pixels[..., 3] = holes[rows[:, None], columns]
        texture = Texture(pixels, texture.wrap_u, texture.wrap_v)
    if factor is None:
        factor = [255] * 4 if texture is not None else [204, 204, 204, 255]
    rgba = np.resize(np.array(factor, dtype=np.float64) / 255.0, 4)
    if image is not None and not rgba[:3].any():
        rgba[:3] = 1.0  # exporters write a black Kd with map_Kd, but mean the map alone
    alpha = _opacity(extra, float(rgba[3]))
    mode = alpha_mode_of(texture) if alpha >= _OPAQUE_FROM else AlphaMode.BLEND
    red, green, blue = (float(value) for value in linear_from_srgb(rgba[:3]))
    return Material(name, (red, green, blue, alpha), texture, mode, double_sided=True)


def _linear_colors(colors: Bytes) -> Floats32:
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


def _hole_map(extra: dict[str, Any], assets: Mapping[str, bytes]) -> Bytes | None:
    """Opacity levels (height, width) uint8 from MTL's `map_d`; None: no usable map."""
    if not extra.get("map_d"):
        return None
    try:
        pixels = rgba8(Image.open(io.BytesIO(assets[" ".join(extra["map_d"])])))
    except Exception:  # a missing file is reported already; Pillow raises exceptions of any type
        return None
    holes = pixels[..., 3]
    return holes if (holes < 255).any() else pixels[..., 0]


# Formats that omnisim cannot read, with a conversion for each.

_EXPANDED = (".sdf", ".world", ".urdf", ".xml")  # suffixes before .xacro
SOURCE, TARGET = "{source}", "{target}"  # placeholders in a conversion's command


@dataclass(frozen=True)
class Conversion:
    """Conversion of a format to one that omnisim can read."""

    suffixes: tuple[str, ...]  # suffixes of the format's files, lower case
    format: str  # format name
    advice: str  # sentence that explains the conversion
    # shell command with `{source}` and `{target}` for the two files; empty: no command
    command: str = ""
    target_suffix: str = ".glb"  # suffix of the file that the command writes

    def command_for(self, source: Path) -> str:
        """Command that converts a file and writes the result next to it."""
        target = source.with_suffix("")  # robot.urdf.xacro becomes robot.urdf
        if target.suffix.lower() not in _EXPANDED:
            target = source.with_suffix(self.target_suffix)
        command = self.command.replace(SOURCE, shlex.quote(str(source)))
        return command.replace(TARGET, shlex.quote(str(target)))


def _blender(operator: str) -> str:
    """Command that imports a file into an empty Blender scene and exports the whole scene."""
    return (
        'blender -b --python-expr "import bpy, sys; '
        f"bpy.ops.wm.read_factory_settings(use_empty=True); {operator}(filepath=sys.argv[-2]); "
        'bpy.ops.export_scene.gltf(filepath=sys.argv[-1], export_lights=True)" -- '
        f"{SOURCE} {TARGET}"
    )


_BLENDER = "convert it to glTF with Blender"
_ASSIMP = f"assimp export {SOURCE} {TARGET} -fglb2"
CONVERSIONS = (
    Conversion(
        (".blend",),
        "Blender",
        _BLENDER,
        f'blender -b {SOURCE} --python-expr "import bpy, sys; '
        f'bpy.ops.export_scene.gltf(filepath=sys.argv[-1], export_lights=True)" -- {TARGET}',
    ),
    Conversion((".fbx",), "FBX", _BLENDER, _blender("bpy.ops.import_scene.fbx")),
    Conversion((".abc",), "Alembic", _BLENDER, _blender("bpy.ops.wm.alembic_import")),
    Conversion(
        (".3ds", ".ase", ".lwo", ".ms3d", ".x", ".x3d", ".wrl"),
        "an older exchange format",
        "convert it to glTF with Assimp",
        _ASSIMP,
    ),
    Conversion((".max",), "3ds Max", "export it from 3ds Max as glTF"),
    Conversion((".ma", ".mb"), "Maya", "export it from Maya as FBX, and that with Blender as glTF"),
    Conversion((".c4d",), "Cinema 4D", "export it from Cinema 4D as glTF"),
    Conversion((".skp",), "SketchUp", "export it from SketchUp as glTF"),
    Conversion((".umap", ".uasset"), "Unreal", "export it with Unreal Editor's glTF exporter"),
    Conversion((".xacro",), "xacro", "expand it", f"xacro {SOURCE} > {TARGET}", ".urdf"),
    Conversion(
        (".step", ".stp"),
        "STEP",
        "convert it to glTF with cascadio",
        f'python -c "import sys, cascadio; cascadio.step_to_glb(*sys.argv[1:])" {SOURCE} {TARGET}',
    ),
    Conversion((".iges", ".igs", ".brep", ".fcstd"), "CAD", "export it from FreeCAD as glTF"),
    Conversion((".ifc",), "IFC", "convert it to glTF", f"IfcConvert {SOURCE} {TARGET}"),
    Conversion(
        (".las", ".laz", ".pcd", ".e57", ".pts"),
        "a point cloud without surfaces",
        "make a mesh of it, with CloudCompare or Open3D, and save that as PLY",
    ),
)
_BY_SUFFIX = {suffix: found for found in CONVERSIONS for suffix in found.suffixes}


# Mesh export through trimesh (mypy ignores its functions without annotations).


MIRROR_SUFFIXES = (".glb", ".obj", ".ply")
_FILE_FROM_Z_UP = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])


def check_mesh_target(path: Path) -> None:
    """Check early that a mesh can be written to a path.

    Raises:
        OutputError: an unknown format or a missing folder.
    """
    if path.suffix.lower() not in MIRROR_SUFFIXES:
        raise OutputError(
            f"{path}: unknown mesh format: expected one of {' '.join(MIRROR_SUFFIXES)}, "
            f"got {path.suffix or '(no suffix)'!r}"
        )
    check_target(path)


def write_mirror(path: Path, mesh: UnfoldedMirrorMesh, name: str) -> None:
    """Write a mirror's mesh as GLB, OBJ or PLY; in Blender its z axis points to the pinhole.

    The material is a perfect mirror, and the texture coordinates are those of the unfolded cube.

    Raises:
        OutputError: an unknown format, or a file that cannot be written; no partial file remains.
    """
    check_mesh_target(path)
    u, v = mesh.texture_coordinates.T
    if path.suffix.lower() == ".ply":  # unchanged axes, no material
        # Blender and MeshLab read the vertex properties s and t as texture coordinates
        attributes = {"s": u.astype(np.float32), "t": (1.0 - v).astype(np.float32)}
        plain = trimesh.Trimesh(
            mesh.vertices_m,
            mesh.triangles,
            vertex_normals=mesh.normals,
            vertex_attributes=attributes,
            process=False,
        )
        data = plain.export(file_type="ply", vertex_normal=True, include_attributes=True)
    else:  # glTF is y up, and most OBJ readers assume that too
        exported = trimesh.Trimesh(
            mesh.vertices_m @ _FILE_FROM_Z_UP.T,
            mesh.triangles,
            vertex_normals=mesh.normals @ _FILE_FROM_Z_UP.T,
            visual=trimesh.visual.TextureVisuals(  # type: ignore[no-untyped-call]
                np.stack((u, 1.0 - v), axis=-1),  # trimesh's v points up
                trimesh.visual.material.PBRMaterial(  # type: ignore[no-untyped-call]
                    "mirror", baseColorFactor=[1.0] * 4, metallicFactor=1.0, roughnessFactor=0.0
                ),
            ),
            process=False,
        )
        if path.suffix.lower() == ".glb":
            scene = trimesh.Scene()
            scene.add_geometry(exported, geom_name=name, node_name=name)
            data = scene.export(  # type: ignore[no-untyped-call]
                file_type="glb", include_normals=True
            )
        else:
            data = exported.export(file_type="obj", include_normals=True, write_texture=False)
            # no material file, because MTL cannot describe mirrors
            lines = str(data).split("\n")
            data = "\n".join(x for x in lines if not x.startswith(("mtllib", "usemtl")))
    with atomic_write(path) as partial:
        partial.write_bytes(data if isinstance(data, bytes) else str(data).encode())
