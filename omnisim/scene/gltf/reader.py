"""Importer: meshes, materials, instances and lights, exactly as a glTF file states them."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.errors import SceneError
from omnisim.scene.asset_resolver import AssetResolver
from omnisim.scene.gltf.accessors import Accessors
from omnisim.scene.gltf.animated_objects import moving_objects, unplayed_parts
from omnisim.scene.gltf.animations import animated_nodes, read_animation, transforms_at_start
from omnisim.scene.gltf.container import read_container
from omnisim.scene.gltf.features import SUPPORTED_EXTENSIONS, DrawnObjects, feature_notices
from omnisim.scene.gltf.json_object import JsonObject
from omnisim.scene.gltf.lights import read_lights
from omnisim.scene.gltf.materials import Materials, is_unlit
from omnisim.scene.gltf.nodes import file_from_nodes, parent_from_node, scene_parents
from omnisim.scene.gltf.primitives import POINTS_AND_LINES, TRIANGLES, Primitive
from omnisim.scene.gltf.skins import joint_matrices, skin_vertices
from omnisim.scene.imported import ImportedScene, colors_rgba, make_mesh, translate
from omnisim.scene.model import Instance, Mesh
from omnisim.scene.textures import TextureStore


def read_gltf(
    data: bytes,
    textures: TextureStore,
    assets: AssetResolver,
    world_from_file: NDArray[np.float64],
    animation_name: str | None = None,
) -> ImportedScene:
    """Read a glTF or GLB file; it plays the animation of a name, by default the first.

    Raises:
        SceneError: it is damaged, requires an extension that is not supported, or has no animation
            of this name.
    """
    root, chunk = read_container(data)
    unsupported = set(map(str, root.array("extensionsRequired"))) - SUPPORTED_EXTENSIONS
    if unsupported:
        raise SceneError(
            f"requires the glTF extension {', '.join(sorted(unsupported))}, which omnisim does not "
            "read: export the scene without it"
        )
    nodes, accessors = root.objects("nodes"), Accessors(root, chunk, assets)
    parents = scene_parents(root, nodes)
    rest = file_from_nodes(parents, {index: parent_from_node(nodes[index]) for index in parents})
    animation = read_animation(root, nodes, accessors, animation_name)
    local = transforms_at_start(nodes, parents, animation)
    poses = file_from_nodes(parents, local)
    materials = Materials(root, accessors, textures, assets)
    meshes = _Meshes(root, accessors, materials)
    placed = list(meshes.instantiate(nodes, poses, rest))
    moved = animated_nodes(nodes, parents, local, animation, world_from_file)
    objects = moving_objects(nodes, [owner for owner, _ in placed], moved, world_from_file)
    drawn = dataclasses.replace(
        _drawn_objects(root, [nodes[index] for index in poses], materials.entries[:-1]),
        **unplayed_parts(root, nodes, animation, moved, objects),
    )
    extensions = [str(name) for name in root.array("extensionsUsed")]
    return ImportedScene(
        tuple(meshes.meshes),
        materials.read({mesh.material for mesh in meshes.meshes}),
        tuple(instance for _, instance in placed),
        [*materials.notices, *feature_notices(drawn, extensions)],
        read_lights(root, nodes, {index: world_from_file @ pose for index, pose in poses.items()}),
        objects=objects,
    )


def _drawn_objects(
    root: JsonObject, nodes: list[JsonObject], materials: list[JsonObject]
) -> DrawnObjects:
    """Objects that the nodes of the scene draw."""
    meshes = root.objects("meshes")
    drawn = [(node, meshes[node.index("mesh", meshes)]) for node in nodes if node.has("mesh")]
    primitives = [
        entry
        for mesh in {mesh.place: mesh for _, mesh in drawn}.values()
        for entry in mesh.objects("primitives")
    ]
    used = {entry.index("material", materials) for entry in primitives if entry.has("material")}
    lit = [index for index in sorted(used) if not is_unlit(materials[index])]
    return DrawnObjects(
        nodes=nodes,
        weights=[node if node.has("weights") else mesh for node, mesh in drawn],
        primitives=primitives,
        materials=[materials[index] for index in lit],
        samplers=root.objects("samplers"),
    )


class _Part(NamedTuple):
    """Primitive of a glTF mesh as a mesh of the scene, and that mesh's origin."""

    primitive: Primitive
    mesh: int
    center: NDArray[np.float64]


class _Meshes:
    """Meshes of a file, one for each primitive. All methods raise SceneErrors.

    Attributes:
        meshes: those of the file; `instantiate` adds the skinned ones.
    """

    def __init__(self, root: JsonObject, accessors: Accessors, materials: Materials):
        self.meshes: list[Mesh] = []
        self._accessors, self._materials, self._skins = accessors, materials, root.objects("skins")
        self._name_counts: dict[str, int] = {}
        self._parts = [
            list(self._read(mesh, mesh.text("name", f"mesh {index}")))
            for index, mesh in enumerate(root.objects("meshes"))
        ]

    def instantiate(
        self,
        nodes: list[JsonObject],
        poses: dict[int, NDArray[np.float64]],
        rest: dict[int, NDArray[np.float64]],
    ) -> Iterator[tuple[int | None, Instance]]:
        """Instances of the nodes, with their indices; skins have none, and the poses at rest.

        Their `world_from_mesh` is still file_from_mesh.
        """
        for index, pose in poses.items():
            node = nodes[index]
            if not node.has("mesh"):
                continue
            name = node.text("name", f"node {index}")
            for part in self._parts[node.index("mesh", self._parts)]:
                if node.has("skin") and part.primitive.has("JOINTS_0"):
                    skin = self._skins[node.index("skin", self._skins)]
                    mesh, center = self._skin(part, joint_matrices(skin, self._accessors, rest))
                    yield None, Instance(name, mesh, translate(np.eye(4), center))
                else:
                    yield index, Instance(name, part.mesh, translate(pose, part.center), pose)

    def _read(self, mesh: JsonObject, name: str) -> Iterator[_Part]:
        entries = self._materials.entries
        for entry in mesh.objects("primitives"):
            if entry.integer("mode", TRIANGLES) in POINTS_AND_LINES:
                continue
            primitive, material = Primitive(entry, self._accessors), len(entries) - 1
            if entry.has("material"):
                material = entry.index("material", entries[:-1])
            positions, colors = primitive.required("POSITION", 3), primitive.attribute("COLOR_0")
            triangles = primitive.triangles(len(positions))
            if not len(triangles):
                continue
            made, center = make_mesh(
                self._unique(name),
                positions,
                triangles,
                material,
                normals=primitive.attribute("NORMAL"),
                texture_coordinates=self._materials.uv(primitive, material),
                colors=None if colors is None else colors_rgba(colors, 1.0),
                second_texture_coordinates=self._materials.second_uv(primitive, material),
            )
            self.meshes.append(made)
            yield _Part(primitive, len(self.meshes) - 1, center)

    def _unique(self, name: str) -> str:
        """The name, numbered where another mesh has it."""
        unique, number = name, self._name_counts.get(name, 0)
        while unique in self._name_counts:
            number += 1
            unique = f"{name}_{number}"
        self._name_counts |= {unique: 0, name: number}
        return unique

    def _skin(self, part: _Part, matrices: NDArray[np.float64]) -> tuple[int, NDArray[np.float64]]:
        """Index and origin of a skinned copy of a part's mesh."""
        mesh = self.meshes[part.mesh]
        positions, normals = skin_vertices(part.primitive, matrices)
        skinned, center = make_mesh(
            mesh.name, positions, mesh.triangles, mesh.material,
            normals, mesh.texture_coordinates, mesh.colors, mesh.second_texture_coordinates,
        )  # fmt: skip
        self.meshes.append(skinned)
        return len(self.meshes) - 1, center
