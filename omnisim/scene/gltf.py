"""glTF and GLB: meshes, materials and instances exactly as the file states them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.errors import SceneError
from omnisim.scene.asset_resolver import AssetResolver
from omnisim.scene.content import Content
from omnisim.scene.gltf_arrays import GltfArrays
from omnisim.scene.gltf_header import read_header
from omnisim.scene.gltf_nodes import node_poses
from omnisim.scene.gltf_pictures import open_pictures, picture_of
from omnisim.scene.gltf_primitives import POINTS_AND_LINES, Primitive, read_primitive
from omnisim.scene.gltf_skins import skinned
from omnisim.scene.mesh_data import colors_rgba, make_mesh, moved
from omnisim.scene.model import AlphaMode, Instance, Material, Mesh, Wrap
from omnisim.scene.punctual_lights import read_lights
from omnisim.scene.textures import TextureStore

_REPEAT, _MIRRORED, _CLAMP = 10497, 33648, 33071  # OpenGL's numbers, as samplers state them
_ALPHA_MODES = {mode.name: mode for mode in AlphaMode}
# What a header of the wrong shapes can raise where `gltf_check` has not looked.
_HEADER_FAULTS = (
    LookupError, TypeError, ValueError, AttributeError, ArithmeticError, RecursionError,
)  # fmt: skip


def read_gltf(
    path: Path,
    data: bytes,
    textures: TextureStore,
    resolver: AssetResolver,
    world_from_file: NDArray[np.float64],
) -> Content:
    """Read a glTF or GLB file.

    Raises:
        SceneError: it is damaged, or requires an extension that nothing here reads.
    """
    try:
        header, rest = read_header(path, data)
        poses = node_poses(header)
        reader = GltfReader(header, GltfArrays(header, rest, resolver), textures, resolver.missing)
        meshes, materials, instances = reader.read(poses)
        lights = read_lights(poses, header, world_from_file)
        notices = [*reader.notices, *_left_out(header)]
    except _HEADER_FAULTS as reason:
        raise SceneError(f"its JSON does not hold together: {reason!r}") from None
    return Content(meshes, materials, instances, notices, lights)


def _left_out(header: dict[str, Any]) -> list[str]:
    """One line for each thing in the file that is not drawn."""
    meshes = header.get("meshes", [])
    modes = {primitive.get("mode", 4) for mesh in meshes for primitive in mesh["primitives"]}
    holders = [*meshes, *header.get("nodes", [])]
    morphed = any(any(holder.get("weights", ())) for holder in holders)
    extensions = header.get("extensionsUsed", [])
    checks = (
        (modes & POINTS_AND_LINES, "points and lines are not drawn"),
        (header.get("animations"), "animations are not played"),
        (morphed, "morph targets are not applied"),
        (
            "EXT_mesh_gpu_instancing" in extensions,
            "EXT_mesh_gpu_instancing is not read: one of each is drawn",
        ),
    )
    return [words for found, words in checks if found]


class _Read(NamedTuple):
    """A primitive, and the mesh that it became."""

    primitive: Primitive
    mesh: int
    middle: NDArray[np.float64]


class GltfReader:
    """Turns a glTF file into our data."""

    def __init__(
        self,
        header: dict[str, Any],
        arrays: GltfArrays,
        textures: TextureStore,
        missing: list[str],
    ):
        self._header, self._arrays = header, arrays
        self._missing = missing  # files that were asked for and are not there
        self._textures = textures
        self._pictures = open_pictures(header, arrays)
        self._used: set[int] = set()  # materials
        self.notices: list[str] = []

    def read(
        self, poses: Mapping[int, NDArray[np.float64]]
    ) -> tuple[tuple[Mesh, ...], tuple[Material, ...], tuple[Instance, ...]]:
        """Return meshes, materials and instances; world_from_mesh is still file_from_mesh.

        Args:
            poses: (4, 4) file_from_node of the nodes that are drawn.

        Raises:
            SceneError: damaged vertices or indices.
        """
        meshes: list[Mesh] = []
        names: set[str] = set()
        read = []
        for index, data in enumerate(self._header.get("meshes", [])):
            of_mesh = []
            for number, primitive in enumerate(data["primitives"]):
                place = f"meshes[{index}].primitives[{number}]"
                name = _free_name(str(data.get("name", f"mesh {index}")), names)
                found = self._primitive(primitive, name, place, meshes)
                if found is not None:
                    of_mesh.append(found)
                    names.add(name)
            read.append(of_mesh)
        materials = tuple(
            self._material(index, data)
            for index, data in enumerate([*self._header.get("materials", []), {}])
        )
        instances = self._instances(poses, read, meshes)
        return tuple(meshes), materials, instances

    def _primitive(
        self, data: dict[str, Any], name: str, place: str, meshes: list[Mesh]
    ) -> _Read | None:
        """Read a primitive and add its mesh to `meshes`; None where it has no triangles."""
        try:
            primitive = read_primitive(self._arrays, data)
        except SceneError as reason:
            raise SceneError(f"{place}: {reason}") from None
        if primitive is None:
            return None  # points and lines, of which `_left_out` speaks
        material = data.get("material", len(self._header.get("materials", [])))
        self._used.add(material)
        made = self._mesh(name, primitive, material)
        if made is None:
            return None
        meshes.append(made[0])
        return _Read(primitive, len(meshes) - 1, made[1])

    def _mesh(
        self, name: str, primitive: Primitive, material: int
    ) -> tuple[Mesh, NDArray[np.float64]] | None:
        attributes = primitive.attributes
        coordinates = attributes.get(f"TEXCOORD_{self._coordinate_set(material)}")
        if coordinates is not None:
            coordinates = self._transformed(coordinates, material)
            # a mirrored texture is stored with its mirror image beside it
            mirrored = [wrap == _MIRRORED for wrap in self._wraps(material)]
            coordinates = coordinates * np.where(mirrored, 0.5, 1.0)
        colors = attributes.get("COLOR_0")
        return make_mesh(
            name,
            attributes["POSITION"],
            primitive.triangles,
            material,
            normals=attributes.get("NORMAL"),
            texture_coordinates=coordinates,
            colors=None if colors is None else colors_rgba(colors, 1.0),
        )

    def _instances(
        self,
        poses: Mapping[int, NDArray[np.float64]],
        read: list[list[_Read]],
        meshes: list[Mesh],
    ) -> tuple[Instance, ...]:
        """All instances; skinned ones get a mesh of their own, which is added to `meshes`."""
        instances = []
        for index, file_from_node in poses.items():
            node = self._header["nodes"][index]
            for primitive, mesh, middle in read[node["mesh"]] if "mesh" in node else ():
                file_from_mesh = file_from_node
                if "skin" in node and "JOINTS_0" in primitive.attributes:
                    made = self._skinned(poses, primitive, node["skin"], meshes[mesh])
                    mesh, middle, file_from_mesh = len(meshes), made[1], np.eye(4)
                    meshes.append(made[0])
                label = str(node.get("name", f"node {index}"))
                instances.append(Instance(label, mesh, moved(file_from_mesh, middle)))
        return tuple(instances)

    def _skinned(
        self,
        poses: Mapping[int, NDArray[np.float64]],
        primitive: Primitive,
        skin: int,
        mesh: Mesh,
    ) -> tuple[Mesh, NDArray[np.float64]]:
        data, binds = self._header["skins"][skin], None
        if "inverseBindMatrices" in data:  # stored column after column
            stored = self._arrays.array(data["inverseBindMatrices"])
            binds = stored.reshape(-1, 4, 4).swapaxes(1, 2)
        positions, normals = skinned(poses, data, primitive.attributes, binds)
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
        if "index" in info and index in self._used:
            picture = picture_of(self._header["textures"][info["index"]])
            if picture is None or self._pictures[picture] is None:
                image = {} if picture is None else self._header["images"][picture]
                if image.get("uri") not in self._missing:
                    self.notices.append(
                        f"texture of {name!r} cannot be decoded: its plain colour is drawn"
                    )
            else:
                wraps = self._wraps(index)
                texture = self._textures.texture(
                    self._pictures[picture],
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


def _free_name(name: str, taken: set[str]) -> str:
    """A name for the next primitive of a mesh: the mesh's own, or with a number behind it."""
    free, number = name, 0
    while free in taken:
        number += 1
        free = f"{name}_{number}"
    return free
