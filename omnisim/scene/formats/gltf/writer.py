"""GLB export of scenes: geometry once per mesh, instances, materials, lights."""

from __future__ import annotations

import io
import itertools
import json
import math
import struct
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from omnisim.core.arrays import Floats
from omnisim.core.errors import OutputError
from omnisim.core.version import __version__
from omnisim.scene.formats.gltf.materials import DEFAULT_IOR
from omnisim.scene.formats.imported_scene import make_mesh, world_from_axes
from omnisim.scene.light.lighting import DEFAULT_BACKGROUND, DEFAULT_LIGHTING, FILL_AMBIENT, is_even
from omnisim.scene.model import Scene
from omnisim.scene.parts import (
    IDENTITY_UV,
    AlphaMode,
    Instance,
    Light,
    LightKind,
    Material,
    Mesh,
    Texture,
    Wrap,
)

_ARRAY_BUFFER, _INDEX_BUFFER = 34962, 34963  # OpenGL's constants
_COMPONENTS = {"f": 5126, "H": 5123, "I": 5125}  # by NumPy's type characters
_SHAPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
_MAX_BYTES = 2**32 - 1  # size of a GLB file
Entry = dict[str, Any]


def write_glb(scene: Scene, path: Path) -> list[str]:
    """Write a scene as GLB, with its dynamic objects posed as at 0 s.

    Returns:
        Notices for content that the file cannot hold, one line each.

    Raises:
        OutputError: the scene exceeds the size limit of a GLB file.
    """
    document = _Document(scene.at_start())
    with path.open("wb") as file:
        document.write(file)
    return [*document.materials.notices, *_left_out(scene)]


def _left_out(scene: Scene) -> list[str]:
    counts = {
        "starts": len(scene.starts), "paths": len(scene.paths), "labels": len(scene.labels),
        "landmarks": len(scene.landmarks),
    }  # fmt: skip
    omitted = ", ".join(f"{name} ({count})" for name, count in counts.items() if count)
    lines = [f"{omitted}: not in the GLB file; state them in a scene's TOML"] if omitted else []
    lighting = scene.lighting
    if lighting.baked is not None:
        lines.append("baked light: not in the GLB file; omnisim bake computes it again")
    if lighting.ambient not in (FILL_AMBIENT, DEFAULT_LIGHTING.ambient):
        lines.append("ambient light: not in the GLB file")
    if lighting.fog is not None:
        lines.append("fog: not in the GLB file; state it in a scene's TOML")
    if scene.background != DEFAULT_BACKGROUND:
        lines.append("background: not in the GLB file; state it in a scene's TOML")
    return lines


class _Document:
    """JSON and binary data of a GLB file."""

    def __init__(self, scene: Scene):
        self._blobs: list[memoryview] = []
        self._views: list[Entry] = []
        self._accessors: list[Entry] = []
        self._size = 0
        self.materials = WrittenMaterials(lambda data: self._add_view(memoryview(data), None))
        for material in scene.materials:
            self.materials.add(matte(material) if scene.lighting.is_matte else material)
        nodes, meshes = node_meshes(scene)
        lights = scene.lighting.lights
        # default lights are not written: they only replace missing ones
        written = () if is_even(scene.lighting) else lights
        light_entries, light_nodes = written_lights(written)
        root: Entry = {
            "asset": {"version": "2.0", "generator": f"omnisim {__version__}"},
            "scene": 0,
            # readers take the last node first, so this keeps the order of the instances
            "scenes": [{"nodes": list(range(len(nodes) + len(light_nodes)))[::-1]}],
            "nodes": [*nodes, *light_nodes],
            "meshes": [
                {
                    "name": scene.meshes[each.meshes[0]].name,
                    "primitives": [
                        self._primitive(baked_mesh(scene.meshes[index], matrix))
                        for index, matrix in zip(each.meshes, each.node_from_meshes, strict=True)
                    ],
                }
                for each in meshes
            ],
            "materials": self.materials.entries,
            "textures": self.materials.textures,
            "samplers": self.materials.samplers,
            "images": self.materials.images,
        }
        used = set(self.materials.extensions)
        if light_entries:
            used.add("KHR_lights_punctual")
            root["extensions"] = {"KHR_lights_punctual": {"lights": light_entries}}
        root |= {
            "extensionsUsed": sorted(used),
            "accessors": self._accessors,
            "bufferViews": self._views,
            "buffers": [{"byteLength": self._size}],
        }
        self._root = {key: value for key, value in root.items() if value != []}

    def write(self, file: BinaryIO) -> None:
        """Write the file.

        Raises:
            OutputError: the file would exceed the size limit of GLB.
        """
        text = json.dumps(self._root, ensure_ascii=False, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        total = 12 + 8 + len(text) + 8 + self._size
        if total > _MAX_BYTES:
            raise OutputError(f"expected at most {_MAX_BYTES} bytes of a GLB file, got {total}")
        file.write(struct.pack("<4s2I", b"glTF", 2, total))
        file.write(struct.pack("<I4s", len(text), b"JSON") + text)
        file.write(struct.pack("<I4s", self._size, b"BIN\0"))
        for blob in self._blobs:
            file.write(blob)
            file.write(bytes(-len(blob) % 4))

    def _primitive(self, mesh: Mesh) -> Entry:
        arrays = {
            "POSITION": mesh.positions, "NORMAL": mesh.normals,
            "TEXCOORD_0": mesh.texture_coordinates, "TEXCOORD_1": mesh.second_texture_coordinates,
            "COLOR_0": mesh.colors,
        }  # fmt: skip
        attributes = {
            name: self._accessor(array, _ARRAY_BUFFER, name == "POSITION")
            for name, array in arrays.items()
            if array is not None
        }
        small = len(mesh.positions) < 65535  # index 65535 is reserved
        indices = mesh.triangles.astype(np.uint16 if small else np.uint32).reshape(-1, 1)
        return {
            "attributes": attributes,
            "indices": self._accessor(indices, _INDEX_BUFFER, False),
            "material": mesh.material,
        }

    def _accessor(self, array: NDArray[np.generic], target: int, has_bounds: bool) -> int:
        values = np.ascontiguousarray(array)
        entry: Entry = {
            "bufferView": self._add_view(values.data.cast("B"), target),
            "componentType": _COMPONENTS[values.dtype.char],
            "count": len(values),
            "type": _SHAPES[values.shape[1]],
        }
        if has_bounds:
            entry |= {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        self._accessors.append(entry)
        return len(self._accessors) - 1

    def _add_view(self, data: memoryview, target: int | None) -> int:
        view: Entry = {"buffer": 0, "byteOffset": self._size, "byteLength": len(data)}
        self._views.append(view if target is None else {**view, "target": target})
        self._blobs.append(data)
        self._size += len(data) + -len(data) % 4
        return len(self._views) - 1


# Nodes and meshes of an exported glTF file.

_MAX_ERROR = 1e-6  # relative to a mesh's size, for vertices moved to the node's frame
_SAME = 1e-9
_UNIT = 5e-4  # tolerance for the length of normals in glTF's validator


class NodeMesh(NamedTuple):
    """Mesh of a glTF file: scene meshes that always occur together in a node."""

    meshes: tuple[int, ...]  # indices of the scene meshes
    node_from_meshes: tuple[Floats, ...]  # (4, 4) transforms to apply to each mesh's vertices


def node_meshes(scene: Scene) -> tuple[list[Entry], list[NodeMesh]]:
    """Nodes of the instances, in order, and the meshes that they reference.

    Parts of an instance with a common frame become one node with that frame's axes, and their
    vertices are moved into it. A mesh whose instances differ in this transform is left unchanged,
    and its nodes use its own frame.
    """
    file_from_world = world_from_axes("y", 1.0).T
    frames = _node_from_meshes(scene)
    nodes: list[Entry] = []
    rows: dict[tuple[int, ...], int] = {}
    meshes: list[NodeMesh] = []

    def node_of(numbered: tuple[int, Instance]) -> tuple[str, bytes, int]:
        number, instance = numbered
        own = number if frames[instance.mesh] is None else -1
        return instance.name, instance.world_from_node.tobytes(), own

    for (name, _, _), group in itertools.groupby(enumerate(scene.instances), node_of):
        parts = [instance for _, instance in group]
        indices = tuple(part.mesh for part in parts)
        node_from_meshes = [frames[index] for index in indices]
        matrix = file_from_world @ parts[0].world_from_mesh
        if node_from_meshes[0] is not None:
            matrix = file_from_world @ parts[0].world_from_node @ file_from_world.T
        if indices not in rows:
            rows[indices] = len(meshes)
            matrices = tuple(np.eye(4) if mesh is None else mesh for mesh in node_from_meshes)
            meshes.append(NodeMesh(indices, matrices))
        nodes.append({"name": name, "mesh": rows[indices], "matrix": matrix.T.ravel().tolist()})
    return nodes, meshes


def baked_mesh(mesh: Mesh, node_from_mesh: Floats) -> Mesh:
    """Mesh with vertices in the frame of its node, and unit normals."""
    linear = node_from_mesh[:3, :3]
    points = mesh.positions.astype(np.float64) @ linear.T + node_from_mesh[:3, 3]
    normals = mesh.normals
    if normals is not None:
        if not np.array_equal(linear, np.eye(3)):
            turned = normals.astype(np.float64) @ np.linalg.inv(linear)
            normals = turned.astype(np.float32)
        lengths = np.linalg.norm(normals, axis=1)
        off = np.abs(lengths - 1.0) > _UNIT
        if off.any():
            normals = normals.copy()
            normals[off] /= np.where(lengths > 0.0, lengths, 1.0)[off, None]
            normals[lengths == 0.0] = (0.0, 1.0, 0.0)
    flips = np.linalg.det(linear) < 0.0
    return replace(
        mesh,
        positions=points.astype(np.float32),
        triangles=mesh.triangles[:, ::-1] if flips else mesh.triangles,
        normals=normals,
    )


def _node_from_meshes(scene: Scene) -> list[Floats | None]:
    """Transform (4, 4) of each mesh to its nodes' frames, y up; None: the mesh's own frame."""
    matrices: list[Floats | None] = [None] * len(scene.meshes)
    differs = [False] * len(scene.meshes)
    file_from_world = world_from_axes("y", 1.0).T
    for instance in scene.instances:
        matrix = None
        if np.isfinite(np.linalg.cond(instance.world_from_node)):
            matrix = file_from_world @ (
                np.linalg.inv(instance.world_from_node) @ instance.world_from_mesh
            )
            if not abs(np.linalg.det(matrix[:3, :3])) > 0.0:
                matrix = None
        first = matrices[instance.mesh]
        if matrix is None or (first is not None and not np.allclose(matrix, first, _SAME, _SAME)):
            differs[instance.mesh] = True
        elif first is None:
            matrices[instance.mesh] = matrix
    return [
        None if matrix is None or unlike or not _is_exact(mesh, matrix) else matrix
        for mesh, matrix, unlike in zip(scene.meshes, matrices, differs, strict=True)
    ]


def _is_exact(mesh: Mesh, node_from_mesh: Floats) -> bool:
    """True if the shape survives the float32 round trip in the node's frame."""
    baked = baked_mesh(replace(mesh, normals=None), node_from_mesh)
    read, center = make_mesh(mesh.name, 0, baked.positions, mesh.triangles)
    linear = node_from_mesh[:3, :3]
    expected = mesh.positions.astype(np.float64) @ linear.T + node_from_mesh[:3, 3] - center
    error = np.abs(read.positions - expected).max()
    return bool(error <= _MAX_ERROR * np.abs(expected).max())


# Materials, textures and images of an exported glTF file.

_WRAPS = {Wrap.REPEAT: 10497, Wrap.CLAMP_TO_EDGE: 33071}  # OpenGL's constants
_SHEAR = 1e-9


class WrittenMaterials:
    """Materials of a scene as JSON, with their textures, samplers and images."""

    def __init__(self, add_view: Callable[[bytes], int]):
        """Initialize with `add_view`, which stores an image and returns its view index."""
        self.entries: list[Entry] = []
        self.textures: list[Entry] = []
        self.samplers: list[Entry] = []
        self.images: list[Entry] = []
        self.extensions: set[str] = set()
        self.notices: list[str] = []  # one line for each property that glTF cannot represent
        self._add_view = add_view
        self._rows: dict[object, int] = {}

    def add(self, material: Material) -> None:
        """Append a material; its index follows the order of the calls."""
        name = material.name
        surface: Entry = {
            "baseColorFactor": list(material.base_color),
            "metallicFactor": material.metallic,
            "roughnessFactor": material.roughness,
        }
        entry: Entry = {"name": name, "pbrMetallicRoughness": surface}
        entry["doubleSided"] = material.double_sided
        if material.alpha_mode is not AlphaMode.OPAQUE:
            entry["alphaMode"] = material.alpha_mode.name
        if material.alpha_mode is AlphaMode.MASK:
            entry["alphaCutoff"] = material.alpha_cutoff
        strength, scale = material.occlusion_strength, material.normal_scale
        self._put(surface, "baseColorTexture", material.texture, name)
        self._put(surface, "metallicRoughnessTexture", material.metallic_roughness_map, name)
        self._put(entry, "normalTexture", material.normal_map, name, scale=scale)
        self._put(entry, "occlusionTexture", material.occlusion_map, name, strength=strength)
        self._put(entry, "emissiveTexture", material.emissive_map, name)
        brightest = max(material.emissive)
        if brightest > 0.0:
            entry["emissiveFactor"] = [
                channel / max(brightest, 1.0) for channel in material.emissive
            ]
        if extensions := self._extensions(material):
            self.extensions |= extensions.keys()
            entry["extensions"] = extensions
        self.entries.append(entry)

    def _extensions(self, material: Material) -> dict[str, Entry]:
        if material.unlit:
            return {"KHR_materials_unlit": {}}
        extensions: dict[str, Entry] = {}
        if max(material.emissive) > 1.0:
            strength = {"emissiveStrength": max(material.emissive)}
            extensions["KHR_materials_emissive_strength"] = strength
        if material.ior != DEFAULT_IOR:
            extensions["KHR_materials_ior"] = {"ior": material.ior}
        if (material.specular, *material.specular_color) != (1.0, 1.0, 1.0, 1.0):
            extensions["KHR_materials_specular"] = {
                "specularFactor": material.specular,
                "specularColorFactor": list(material.specular_color),
            }
        if material.specular_map is not None:
            gloss = extensions.setdefault("KHR_materials_specular", {})
            for key in ("specularTexture", "specularColorTexture"):
                self._put(gloss, key, material.specular_map, material.name)
        if material.transmission > 0.0:
            transmission = {"transmissionFactor": material.transmission}
            extensions["KHR_materials_transmission"] = transmission
        if material.thickness_m > 0.0:
            volume: Entry = {"thicknessFactor": material.thickness_m}
            if material.attenuation_distance_m < math.inf:
                volume["attenuationDistance"] = material.attenuation_distance_m
                volume["attenuationColor"] = list(material.attenuation_color)
            extensions["KHR_materials_volume"] = volume
        if material.dispersion > 0.0:
            extensions["KHR_materials_dispersion"] = {"dispersion": material.dispersion}
        if material.clearcoat > 0.0:
            extensions["KHR_materials_clearcoat"] = {
                "clearcoatFactor": material.clearcoat,
                "clearcoatRoughnessFactor": material.clearcoat_roughness,
            }
            coat = extensions["KHR_materials_clearcoat"]
            for key in ("clearcoatTexture", "clearcoatRoughnessTexture"):
                self._put(coat, key, material.clearcoat_map, material.name)
            self._put(
                coat, "clearcoatNormalTexture", material.clearcoat_normal_map, material.name,
                scale=material.clearcoat_normal_scale,
            )  # fmt: skip
        return extensions

    def _put(
        self, owner: Entry, key: str, texture: Texture | None, material: str, **values: float
    ) -> None:
        if texture is None:
            return
        info: Entry = {"index": self._texture(texture), **values}
        if texture.uv_set:
            info["texCoord"] = texture.uv_set
        if texture.uv_transform != IDENTITY_UV:
            transform = _texture_transform(texture)
            if transform is None:
                self.notices.append(f"sheared {key} of {material!r} is left out")
                return
            self.extensions.add("KHR_texture_transform")
            info["extensions"] = {"KHR_texture_transform": transform}
        owner[key] = info

    def _texture(self, texture: Texture) -> int:
        wraps = (texture.wrap_u, texture.wrap_v)
        key = ("texture", id(texture.pixels), wraps)
        if key not in self._rows:
            image = self._image(texture)
            if ("sampler", wraps) not in self._rows:
                sampler = {"wrapS": _WRAPS[wraps[0]], "wrapT": _WRAPS[wraps[1]]}
                self._rows["sampler", wraps] = _append(self.samplers, sampler)
            entry = {"source": image, "sampler": self._rows["sampler", wraps]}
            self._rows[key] = _append(self.textures, entry)
        return self._rows[key]

    def _image(self, texture: Texture) -> int:
        key = ("image", id(texture.pixels))
        if key not in self._rows:
            pixels = texture.pixels
            has_alpha = bool((pixels[..., 3] < 255).any())
            file = io.BytesIO()
            Image.fromarray(pixels if has_alpha else np.ascontiguousarray(pixels[..., :3])).save(
                file, "PNG"
            )
            view = self._add_view(file.getvalue())
            self._rows[key] = _append(self.images, {"bufferView": view, "mimeType": "image/png"})
        return self._rows[key]


def matte(material: Material) -> Material:
    """Material with the base color only, as in scenes with matte materials."""
    return Material(
        material.name, material.base_color, material.texture, material.alpha_mode,
        material.alpha_cutoff, material.double_sided, material.unlit,
    )  # fmt: skip


def _append(entries: list[Entry], entry: Entry) -> int:
    entries.append(entry)
    return len(entries) - 1


def _texture_transform(texture: Texture) -> Entry | None:
    """KHR_texture_transform entry: translation · rotation · scale; None: a shear."""
    (a, b, c), (d, e, f) = texture.uv_transform
    if abs(a * b + d * e) > _SHEAR * (a * a + b * b + d * d + e * e):
        return None
    width = math.hypot(a, d)
    sign = math.copysign(1.0, a * e - b * d)
    rotation, scale = math.atan2(-d, a), [width, sign * math.hypot(b, e)]
    return {"offset": [c, f], "rotation": rotation, "scale": scale}


# Lights of an exported glTF file.

_NARROWEST_RAD = 1e-4  # gap between a spot's cones, which glTF requires to differ


def written_lights(lights: Sequence[Light]) -> tuple[list[Entry], list[Entry]]:
    """Entries of KHR_lights_punctual, and the nodes that reference them."""
    entries, nodes = [], []
    for index, light in enumerate(lights):
        entry: Entry = {
            "type": light.kind.value, "color": list(light.color), "intensity": light.intensity
        }  # fmt: skip
        if light.kind is not LightKind.DIRECTIONAL and math.isfinite(light.range_m):
            entry["range"] = light.range_m
        if light.kind is LightKind.SPOT:
            inner, outer = (math.acos(min(max(cosine, -1.0), 1.0)) for cosine in light.cone_cosines)
            outer = min(max(outer, _NARROWEST_RAD), 0.5 * math.pi)
            inner = min(max(inner, 0.0), outer - _NARROWEST_RAD)
            entry["spot"] = {"innerConeAngle": inner, "outerConeAngle": outer}
        entries.append(entry)
        matrix, extensions = _file_from_light(light), {"KHR_lights_punctual": {"light": index}}
        node = {"name": f"light {index}", "matrix": matrix.T.ravel().tolist()}
        nodes.append({**node, "extensions": extensions})
    return entries, nodes


def _file_from_light(light: Light) -> Floats:
    """Pose (4, 4) of a light that shines along its −z, in the y-up file."""
    matrix = np.eye(4)
    if light.kind is not LightKind.POINT:
        matrix[:3, 2] = -light.direction
        matrix[:3, 0] = np.cross(np.eye(3)[np.argmin(np.abs(light.direction))], matrix[:3, 2])
        matrix[:3, 0] /= np.linalg.norm(matrix[:3, 0])
        matrix[:3, 1] = np.cross(matrix[:3, 2], matrix[:3, 0])
    if light.kind is not LightKind.DIRECTIONAL:
        matrix[:3, 3] = light.position_m
    file_from_world: Floats = world_from_axes("y", 1.0).T
    return file_from_world @ matrix
