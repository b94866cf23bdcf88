"""From a glTF file to meshes, materials, instances and lights, exactly as it states them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.errors import SceneError
from omnisim.scene.asset_resolver import AssetResolver
from omnisim.scene.gltf import schema
from omnisim.scene.gltf.accessors import Accessors
from omnisim.scene.gltf.container import split_chunks
from omnisim.scene.gltf.lights import read_lights
from omnisim.scene.gltf.materials import Materials
from omnisim.scene.gltf.nodes import file_from_nodes
from omnisim.scene.gltf.primitives import NOT_DRAWN, Primitive
from omnisim.scene.gltf.skins import joint_matrices, skin_vertices
from omnisim.scene.imported_scene import ImportedScene
from omnisim.scene.mesh_data import colors_rgba, make_mesh, translate
from omnisim.scene.model import Instance, Mesh
from omnisim.scene.textures import TextureStore

# Extensions that a file may require: without the others it cannot be drawn right.
SUPPORTED_EXTENSIONS = {
    "KHR_draco_mesh_compression",  # where DracoPy is installed
    "KHR_lights_punctual",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_unlit",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "EXT_texture_webp",
}


def read_gltf(
    data: bytes,
    textures: TextureStore,
    resolver: AssetResolver,
    world_from_file: NDArray[np.float64],
) -> ImportedScene:
    """Read a glTF or GLB file.

    Raises:
        SceneError: it is damaged, or requires an extension that is not supported.
    """
    text, chunk = split_chunks(data)
    document = schema.parse_document(text)
    unsupported = sorted(set(document.extensions_required) - SUPPORTED_EXTENSIONS)
    if unsupported:
        raise SceneError(
            f"requires the glTF extension {', '.join(unsupported)}, which omnisim does not read: "
            "export the scene without it"
        )
    accessors = Accessors(document, chunk, resolver)
    poses = file_from_nodes(document)
    materials = Materials(document, accessors, textures, resolver)
    meshes = _Meshes(document, accessors, materials)
    instances = meshes.instantiate(poses)
    return ImportedScene(
        tuple(meshes.meshes),
        materials.read({mesh.material for mesh in meshes.meshes}),
        instances,
        [*materials.notices, *_notices(document)],
        read_lights(document, poses, world_from_file),
    )


def _notices(document: schema.Document) -> list[str]:
    """One line for each feature of the file that is not drawn."""
    modes = {primitive.mode for mesh in document.meshes for primitive in mesh.primitives}
    holders: list[schema.Mesh | schema.Node] = [*document.meshes, *document.nodes]
    checks = (
        (modes & NOT_DRAWN, "points and lines are not drawn"),
        (document.animations, "animations are not played"),
        (any(any(holder.weights) for holder in holders), "morph targets are not applied"),
        (
            "EXT_mesh_gpu_instancing" in document.extensions_used,
            "EXT_mesh_gpu_instancing is not read: one of each is drawn",
        ),
    )
    return [notice for found, notice in checks if found]


class _Part(NamedTuple):
    """Primitive of a glTF mesh as a mesh of the scene, and that mesh's origin."""

    primitive: Primitive
    mesh: int
    center: NDArray[np.float64]


class _Meshes:
    """Meshes of a document, one for each primitive.

    Attributes:
        meshes: those of the document; `instantiate` adds the skinned ones.
    """

    def __init__(self, document: schema.Document, accessors: Accessors, materials: Materials):
        self.meshes: list[Mesh] = []
        self._document, self._accessors, self._materials = document, accessors, materials
        self._name_counts: dict[str, int] = {}
        self._parts = [
            [
                part
                for number, primitive in enumerate(entry.primitives)
                if primitive.mode not in NOT_DRAWN
                for part in self._read(
                    primitive,
                    f"mesh {index}" if entry.name is None else entry.name,
                    f"meshes[{index}].primitives[{number}]",
                )
            ]
            for index, entry in enumerate(document.meshes)
        ]

    def instantiate(self, poses: dict[int, NDArray[np.float64]]) -> tuple[Instance, ...]:
        """All instances; their `world_from_mesh` is still file_from_mesh.

        Raises:
            SceneError: a node's mesh or skin is not there, or is damaged.
        """
        instances = []
        for index, pose in poses.items():
            node = self._document.nodes[index]
            if node.mesh is None:
                continue
            name = f"node {index}" if node.name is None else node.name
            for part in schema.lookup(self._parts, node.mesh, f"nodes[{index}].mesh"):
                if node.skin is not None and part.primitive.has("JOINTS_0"):
                    mesh, center = self._skinned(part, node.skin, poses)
                    instances.append(Instance(name, mesh, translate(np.eye(4), center)))
                else:
                    instances.append(Instance(name, part.mesh, translate(pose, part.center)))
        return tuple(instances)

    def _read(self, entry: schema.Primitive, name: str, place: str) -> Iterator[_Part]:
        """The primitive, unless it has no triangles."""
        primitive = Primitive(entry, self._accessors, place)
        material = entry.material
        if material is None:
            material = len(self._document.materials)
        else:
            schema.lookup(self._document.materials, material, f"{place}.material")
        positions, colors = primitive.required("POSITION", 3), primitive.floats("COLOR_0")
        triangles = primitive.triangles(len(positions))
        if not len(triangles):
            return
        mesh, center = make_mesh(
            self._unique(name),
            positions,
            triangles,
            material,
            normals=primitive.floats("NORMAL"),
            texture_coordinates=self._materials.texture_coordinates(primitive, material),
            colors=None if colors is None else colors_rgba(colors, 1.0),
        )
        self.meshes.append(mesh)
        yield _Part(primitive, len(self.meshes) - 1, center)

    def _unique(self, name: str) -> str:
        """The name, numbered where another mesh has it."""
        unique, number = name, self._name_counts.get(name, 0)
        while unique in self._name_counts:
            number += 1
            unique = f"{name}_{number}"
        self._name_counts[name] = number
        self._name_counts.setdefault(unique, 0)
        return unique

    def _skinned(
        self, part: _Part, skin: int, poses: dict[int, NDArray[np.float64]]
    ) -> tuple[int, NDArray[np.float64]]:
        """Index and origin of a skinned copy of a part's mesh."""
        matrices = joint_matrices(skin, self._document, self._accessors, poses)
        positions, normals = skin_vertices(part.primitive, matrices, f"skins[{skin}]")
        mesh = self.meshes[part.mesh]
        skinned, center = make_mesh(
            mesh.name,
            positions,
            mesh.triangles,
            mesh.material,
            normals,
            mesh.texture_coordinates,
            mesh.colors,
        )
        self.meshes.append(skinned)
        return len(self.meshes) - 1, center
