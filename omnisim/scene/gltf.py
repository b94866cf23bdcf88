"""glTF and GLB: meshes, materials and instances exactly as the file states them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

import omnisim.scene.gltf_primitives  # noqa: F401 (its handlers complete what trimesh reads)
from omnisim.errors import SceneError
from omnisim.scene.asset_resolver import AssetResolver
from omnisim.scene.gltf_header import MARKER, marked_file, read_header
from omnisim.scene.gltf_skins import SKINNED_ATTRIBUTES, skinned
from omnisim.scene.imported_scene import ImportedScene, load_with_trimesh
from omnisim.scene.mesh_data import colors_rgba, make_mesh, translate
from omnisim.scene.model import AlphaMode, Instance, Material, Mesh, Wrap
from omnisim.scene.punctual_lights import read_lights
from omnisim.scene.textures import TextureStore

_REPEAT, _MIRRORED, _CLAMP = 10497, 33648, 33071  # OpenGL's numbers, as samplers state them
_ALPHA_MODES = {mode.name: mode for mode in AlphaMode}
_NORMALIZED_SCALE = {"u1": 255.0, "u2": 65535.0, "i1": 127.0, "i2": 32767.0}
# What a header of the wrong shapes can raise where `gltf_check` has not looked.
_HEADER_FAULTS = (
    LookupError, TypeError, ValueError, AttributeError, ArithmeticError, RecursionError,
)  # fmt: skip
_POINTS_AND_LINES = {0, 1, 2, 3}  # OpenGL's numbers of such primitives


def read_gltf(
    path: Path,
    data: bytes,
    textures: TextureStore,
    resolver: AssetResolver,
    world_from_file: NDArray[np.float64],
) -> ImportedScene:
    """Read a glTF or GLB file.

    Raises:
        SceneError: it is damaged, or requires an extension that nothing here reads.
    """
    try:
        header, rest = read_header(path, data)
        loaded = load_with_trimesh(path, marked_file(path, header, rest), resolver)
        reader = GltfReader(header, textures, resolver.missing)
        meshes, materials, instances = reader.read(loaded)
        lights = read_lights(loaded, header, world_from_file)
        notices = [*reader.notices, *_left_out(header)]
    except _HEADER_FAULTS as reason:
        raise SceneError(f"its JSON does not hold together: {reason!r}") from None
    return ImportedScene(meshes, materials, instances, notices, lights)


def _left_out(header: dict[str, Any]) -> list[str]:
    """One line for each thing in the file that is not drawn."""
    meshes = header.get("meshes", [])
    modes = {primitive.get("mode", 4) for mesh in meshes for primitive in mesh["primitives"]}
    holders = [*meshes, *header.get("nodes", [])]
    morphed = any(any(holder.get("weights", ())) for holder in holders)
    extensions = header.get("extensionsUsed", [])
    checks = (
        (modes & _POINTS_AND_LINES, "points and lines are not drawn"),
        (header.get("animations"), "animations are not played"),
        (morphed, "morph targets are not applied"),
        (
            "EXT_mesh_gpu_instancing" in extensions,
            "EXT_mesh_gpu_instancing is not read: one of each is drawn",
        ),
    )
    return [words for found, words in checks if found]


class GltfReader:
    """Turns what trimesh made of a glTF file, and the file's header, into our data."""

    def __init__(self, header: dict[str, Any], textures: TextureStore, missing: list[str]):
        self._header = header
        self._missing = missing  # files that were asked for and are not there
        self._textures = textures
        self._images: dict[int, Any] = {}
        self.notices: list[str] = []

    def read(
        self, loaded: trimesh.Scene
    ) -> tuple[tuple[Mesh, ...], tuple[Material, ...], tuple[Instance, ...]]:
        """Return meshes, materials and instances; world_from_mesh is still file_from_mesh.

        Raises:
            SceneError: damaged vertices or indices.
        """
        meshes: list[Mesh] = []
        index_of: dict[str, tuple[int, NDArray[np.float64]]] = {}
        default_material = len(self._header.get("materials", []))
        for name, geometry in loaded.geometry.items():
            if not isinstance(geometry, trimesh.Trimesh):
                continue  # points and lines, of which `_left_out` speaks
            marker = geometry.metadata.get(MARKER)
            if marker is None:
                raise SceneError(f"mesh {name!r}: its attributes cannot be read")
            material = default_material if marker["material"] is None else marker["material"]
            image = getattr(geometry.visual, "material", None)
            self._images.setdefault(material, getattr(image, "baseColorTexture", None))
            made = self._mesh(name, geometry, marker, material)
            if made is not None:
                index_of[name] = (len(meshes), made[1])
                meshes.append(made[0])
        materials = tuple(
            self._material(index, data)
            for index, data in enumerate([*self._header.get("materials", []), {}])
        )
        instances = self._instances(loaded, index_of, meshes)
        return tuple(meshes), materials, instances

    def _mesh(
        self, name: str, geometry: trimesh.Trimesh, marker: dict[str, Any], material: int
    ) -> tuple[Mesh, NDArray[np.float64]] | None:
        def attribute(key: str) -> NDArray[Any] | None:
            if key not in marker["raw"]:
                return None
            return self._floats(marker["raw"][key], marker["accessors"][key])

        positions = attribute("POSITION")
        coordinates = attribute(f"TEXCOORD_{self._coordinate_set(material)}")
        if coordinates is not None:
            coordinates = self._transformed(coordinates, material)
            # a mirrored texture is stored with its mirror image beside it
            mirrored = [wrap == _MIRRORED for wrap in self._wraps(material)]
            coordinates = coordinates * np.where(mirrored, 0.5, 1.0)
        colors = attribute("COLOR_0")
        return make_mesh(
            name,
            geometry.vertices if positions is None else positions,
            geometry.faces,
            material,
            normals=attribute("NORMAL"),
            texture_coordinates=coordinates,
            colors=None if colors is None else colors_rgba(colors, 1.0),
        )

    def _instances(
        self,
        loaded: trimesh.Scene,
        index_of: dict[str, tuple[int, NDArray[np.float64]]],
        meshes: list[Mesh],
    ) -> tuple[Instance, ...]:
        """All instances; skinned ones get a mesh of their own, which is added to `meshes`."""
        instances = []
        for name in loaded.graph.nodes_geometry:
            file_from_mesh, geometry = loaded.graph[name]
            if geometry not in index_of:
                continue
            # Nodes are named by their indices. trimesh puts the primitives of a mesh below its
            # node, under names of its own.
            index = int(name if name.isdigit() else loaded.graph.transforms.parents[name])
            node = self._header["nodes"][index]
            mesh, middle = index_of[geometry]
            if "skin" in node and "JOINTS_0" in loaded.geometry[geometry].metadata[MARKER]["raw"]:
                made = self._skinned(loaded, geometry, node["skin"], meshes[mesh])
                mesh, middle, file_from_mesh = len(meshes), made[1], np.eye(4)
                meshes.append(made[0])
            label = str(node.get("name", f"node {index}"))
            instances.append(Instance(label, mesh, translate(file_from_mesh, middle)))
        return tuple(instances)

    def _skinned(
        self, loaded: trimesh.Scene, geometry: str, skin: int, mesh: Mesh
    ) -> tuple[Mesh, NDArray[np.float64]]:
        marker = loaded.geometry[geometry].metadata[MARKER]
        attributes = {
            key: self._floats(values, marker["accessors"][key])
            for key, values in marker["raw"].items()
            if key in SKINNED_ATTRIBUTES
        }
        positions, normals = skinned(
            loaded, self._header["skins"][skin], attributes, marker["binds"].get(str(skin))
        )
        made = make_mesh(
            mesh.name,
            positions,
            mesh.triangles,
            mesh.material,
            normals,
            mesh.texture_coordinates,
            mesh.colors,
        )
        if made is None:
            raise SceneError(f"mesh {mesh.name!r}: has a skin and no triangles")
        return made

    def _floats(self, values: NDArray[Any], accessor: int) -> NDArray[Any]:
        """Integers to the fractions that they stand for, where the accessor says `normalized`."""
        kind = values.dtype.str[1:]
        if self._header["accessors"][accessor].get("normalized") and kind in _NORMALIZED_SCALE:
            return np.maximum(values / _NORMALIZED_SCALE[kind], -1.0)
        return values

    def _texture_info(self, material: int) -> dict[str, Any]:
        materials = self._header.get("materials", [])
        data = materials[material] if material < len(materials) else {}
        glossy = data.get("extensions", {}).get("KHR_materials_pbrSpecularGlossiness")
        if glossy is not None:
            return glossy.get("diffuseTexture", {})
        return data.get("pbrMetallicRoughness", {}).get("baseColorTexture", {})

    def _coordinate_set(self, material: int) -> int:
        info = self._texture_info(material)
        transform = info.get("extensions", {}).get("KHR_texture_transform", {})
        return int(transform.get("texCoord", info.get("texCoord", 0)))

    def _transformed(self, coordinates: NDArray[Any], material: int) -> NDArray[Any]:
        """Source: KHR_texture_transform, translation · rotation · scale."""
        extensions = self._texture_info(material).get("extensions", {})
        transform = extensions.get("KHR_texture_transform")
        if transform is None:
            return coordinates
        scaled = np.asarray(coordinates, dtype=np.float64) * transform.get("scale", (1.0, 1.0))
        cos, sin = np.cos(transform.get("rotation", 0.0)), np.sin(transform.get("rotation", 0.0))
        return scaled @ np.array([[cos, -sin], [sin, cos]]) + transform.get("offset", (0.0, 0.0))

    def _material(self, index: int, data: dict[str, Any]) -> Material:
        extensions = data.get("extensions", {})
        glossy = extensions.get("KHR_materials_pbrSpecularGlossiness")
        if glossy is None:
            factor = data.get("pbrMetallicRoughness", {}).get("baseColorFactor", (1.0,) * 4)
        else:
            factor = glossy.get("diffuseFactor", (1.0,) * 4)
        name = str(data.get("name", f"material {index}"))
        texture, info = None, self._texture_info(index)
        if "index" in info and index in self._images:
            if self._images[index] is None:
                source = self._header["textures"][info["index"]].get("source")
                image = {} if source is None else self._header["images"][source]
                if image.get("uri") not in self._missing:
                    self.notices.append(
                        f"texture of {name!r} cannot be decoded: its plain colour is drawn"
                    )
            else:
                wraps = self._wraps(index)
                texture = self._textures.texture(
                    self._images[index],
                    name,
                    wraps=tuple(Wrap.CLAMP_TO_EDGE if w == _CLAMP else Wrap.REPEAT for w in wraps),
                    mirrored=tuple(w == _MIRRORED for w in wraps),
                )
        red, green, blue, alpha = (float(value) for value in factor)
        mode = _ALPHA_MODES.get(data.get("alphaMode"), AlphaMode.OPAQUE)
        return Material(
            name=name,
            base_color=(red, green, blue, alpha),
            texture=texture,
            alpha_mode=mode,
            alpha_cutoff=float(data.get("alphaCutoff", 0.5)),
            double_sided=bool(data.get("doubleSided", False)),
            unlit="KHR_materials_unlit" in extensions,
        )

    def _wraps(self, material: int) -> tuple[int, int]:
        """OpenGL's numbers for what lies beyond the texture's edges."""
        info = self._texture_info(material)
        data = self._header["textures"][info["index"]] if "index" in info else {}
        sampler = self._header["samplers"][data["sampler"]] if "sampler" in data else {}
        return sampler.get("wrapS", _REPEAT), sampler.get("wrapT", _REPEAT)
