"""GLB export of scenes: geometry once per mesh, instances, materials, lights."""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import OutputError
from omnisim.core.version import __version__
from omnisim.scene.formats.gltf.writing.written_lights import written_lights
from omnisim.scene.formats.gltf.writing.written_materials import WrittenMaterials, matte
from omnisim.scene.formats.gltf.writing.written_meshes import NodeMesh, baked_mesh, node_meshes
from omnisim.scene.light.lighting import DEFAULT_BACKGROUND, DEFAULT_LIGHTING, FILL_AMBIENT, is_even
from omnisim.scene.model import Mesh, Scene

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
    """Notices for content that glTF cannot represent."""
    counts = {
        "starts": len(scene.starts), "paths": len(scene.paths), "labels": len(scene.labels),
        "landmarks": len(scene.landmarks),
    }  # fmt: skip
    omitted = [f"{name} ({count})" for name, count in counts.items() if count]
    lines = (
        [f"{', '.join(omitted)}: not in the GLB file, but for a scene's TOML"] if omitted else []
    )
    lighting = scene.lighting
    if lighting.baked is not None:
        lines.append("baked light: not in the GLB file, but omnisim bake computes it anew")
    if lighting.ambient not in (FILL_AMBIENT, DEFAULT_LIGHTING.ambient):
        lines.append("light from everywhere: not in the GLB file")
    if lighting.fog is not None:
        lines.append("fog: not in the GLB file, but for a scene's TOML")
    if scene.background != DEFAULT_BACKGROUND:
        lines.append("background: not in the GLB file, but for a scene's TOML")
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
            "meshes": [self._mesh(scene.meshes, each) for each in meshes],
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

    def _mesh(self, meshes: Sequence[Mesh], written: NodeMesh) -> Entry:
        """JSON of a mesh, with one primitive for each of the scene's meshes."""
        primitives = [
            self._primitive(baked_mesh(meshes[index], matrix))
            for index, matrix in zip(written.meshes, written.node_from_meshes, strict=True)
        ]
        return {"name": meshes[written.meshes[0]].name, "primitives": primitives}

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
