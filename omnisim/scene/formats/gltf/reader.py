"""Importer for glTF: meshes, materials, instances and lights, exactly as stated in the file."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from omnisim.cameras import CentralCamera
from omnisim.core.arrays import Floats
from omnisim.core.errors import SceneError, printable
from omnisim.core.short_repr import counted
from omnisim.scene.formats.features import Feature, Support, feature_table
from omnisim.scene.formats.gltf.document import Accessors, JsonObject, read_container
from omnisim.scene.formats.gltf.materials import GltfMaterials, has_transmission_map, is_unlit
from omnisim.scene.formats.gltf.nodes import (
    FIRST_ANIMATION,
    AnimationChoice,
    animated_nodes,
    moving_objects,
    read_animation,
    read_copies,
    read_lights,
    reshaped_nodes,
    scene_parents,
    transform_at_start,
)
from omnisim.scene.formats.gltf.primitives import (
    POINTS_AND_LINES,
    TRIANGLES,
    DeformingMeshes,
    PlayedNodes,
    Primitive,
)
from omnisim.scene.formats.imported_scene import (
    Cameras,
    ImportedScene,
    Omissions,
    colors_rgba,
    make_mesh,
    pinhole,
    read_lens,
    translate,
)
from omnisim.scene.formats.resources import AssetResolver
from omnisim.scene.model import Instance, Mesh
from omnisim.scene.textures import TextureStore

# Objects of a file that its scene draws, by the group of the features that they may have.
DrawnObjects = dict[str, Sequence[JsonObject]]


def read_gltf(
    data: bytes,
    textures: TextureStore,
    assets: AssetResolver,
    world_from_file: Floats,
    choice: AnimationChoice = FIRST_ANIMATION,
) -> ImportedScene:
    """Read a glTF or GLB file with the chosen animation.

    Raises:
        SceneError: the file is damaged, requires an unsupported extension, or lacks the chosen
            animation.
    """
    root, chunk = read_container(data)
    unsupported = set(map(str, root.array("extensionsRequired"))) - SUPPORTED_EXTENSIONS
    if unsupported:
        names = ", ".join(map(printable, sorted(unsupported)))
        raise SceneError(
            f"requires the glTF extension {names}, which omnisim does not "
            "read: export the scene without it"
        )
    nodes, accessors = root.objects("nodes"), Accessors(root, chunk, assets)
    parents = scene_parents(root, nodes)
    animation = read_animation(root, nodes, accessors, choice.name)
    local = {
        index: transform_at_start(nodes[index], animation.nodes.get(index)) for index in parents
    }
    poses: dict[int, Floats] = {}
    for index, parent in parents.items():
        above = np.eye(4) if parent is None else poses[parent]
        poses[index] = above @ local[index]
    moved = animated_nodes(nodes, parents, local, animation, world_from_file)
    reshaped = reshaped_nodes(nodes, moved, animation) if choice.moves_objects else set(moved)
    played = PlayedNodes(nodes, poses, moved, reshaped, animation, world_from_file)
    materials = GltfMaterials(root, accessors, textures, assets)
    deforming = DeformingMeshes(root, accessors, played)
    meshes = _Meshes(root, accessors, materials)
    placed = list(meshes.instantiate(nodes, poses, deforming))
    drawn = _drawn_objects(root, [nodes[index] for index in poses], materials.entries[:-1]) | {
        "animations": animation.others,
        "channels": animation.channels,
        "shining": [
            nodes[index] for index in moved if nodes[index].extension("KHR_lights_punctual")
        ],
    }
    in_world = {index: world_from_file @ pose for index, pose in poses.items()}
    extensions = [str(name) for name in root.array("extensionsUsed")]
    cameras = _read_cameras(root, nodes, in_world)
    return ImportedScene(
        tuple(meshes.meshes),
        materials.read({mesh.material for mesh in meshes.meshes}),
        tuple(instance for _, instance in placed),
        [
            *materials.notices,
            *deforming.notices,
            *feature_notices(drawn, extensions),
            *meshes.dropped.notices,
            *cameras.notices,
        ],
        read_lights(root, nodes, in_world),
        cameras=cameras.poses,
        objects=moving_objects(nodes, [owner for owner, _ in placed], moved, world_from_file),
    )


def _drawn_objects(
    root: JsonObject, nodes: list[JsonObject], materials: list[JsonObject]
) -> DrawnObjects:
    """Objects that the nodes of the scene draw; of the materials those that are lit."""
    meshes = root.objects("meshes")
    drawn = [(node, meshes[node.index("mesh", meshes)]) for node in nodes if node.has("mesh")]
    primitives = [
        entry
        for mesh in {mesh.place: mesh for _, mesh in drawn}.values()
        for entry in mesh.objects("primitives")
    ]
    used = {entry.index("material", materials) for entry in primitives if entry.has("material")}
    lit = [index for index in sorted(used) if not is_unlit(materials[index])]
    return {
        "nodes": nodes,
        "primitives": primitives,
        "materials": [materials[index] for index in lit],
        "samplers": root.objects("samplers"),
    }


def _read_cameras(
    root: JsonObject, nodes: list[JsonObject], world_from_node: Mapping[int, Floats]
) -> Cameras:
    """Cameras of the nodes, named after the nodes, or else after the cameras.

    Source: glTF 2.0, section 3.10: a camera looks along −z, with y up; its scale is ignored.
    """
    entries, cameras = root.objects("cameras"), Cameras()
    for index in sorted(world_from_node):
        if nodes[index].has("camera"):
            entry = entries[nodes[index].index("camera", entries)]
            name = nodes[index].text("name", entry.text("name", f"camera {len(cameras.poses)}"))
            cameras.add(name, world_from_node[index], read_lens(partial(_lens, entry)))
    return cameras


def _lens(camera: JsonObject) -> CentralCamera | str:
    if not camera.has("perspective"):
        return "it is orthographic"
    values = camera.object("perspective")
    half_height = math.tan(0.5 * values.number("yfov", 0.0))
    if not half_height > 0.0:
        return "it has no yfov between 0 and π"
    size = 2.0 * half_height * values.number("aspectRatio", 4 / 3), 2.0 * half_height
    return pinhole(size, 1.0)


class _Part(NamedTuple):
    """Primitive of a glTF mesh, with its scene mesh and that mesh's origin."""

    primitive: Primitive
    mesh: int
    center: Floats


class _Meshes:
    """Meshes of a file, one per primitive; `instantiate` appends skinned, morphed and others."""

    def __init__(self, root: JsonObject, accessors: Accessors, materials: GltfMaterials):
        self.meshes: list[Mesh] = []
        self.dropped = Omissions()  # vertex data that do not match their vertices
        self._accessors, self._materials = accessors, materials
        self._name_counts: dict[str, int] = {}
        self._parts = [
            list(self._read(mesh, mesh.text("name", f"mesh {index}")))
            for index, mesh in enumerate(root.objects("meshes"))
        ]

    def instantiate(
        self, nodes: list[JsonObject], poses: dict[int, Floats], deforming: DeformingMeshes
    ) -> Iterator[tuple[int | None, Instance]]:
        """Instances of the nodes at their poses, each with the index of the node that moves it.

        Their `world_from_mesh` is still file_from_mesh.
        """
        for index, pose in poses.items():
            node = nodes[index]
            if not node.has("mesh"):
                continue
            copies = read_copies(node, self._accessors)
            name = node.text("name", f"node {index}")
            parts = self._parts[node.index("mesh", self._parts)]
            if copies is not None:
                for number, file_from_copy in enumerate(pose @ copies):
                    for part in parts:
                        file_from_mesh = translate(file_from_copy, part.center)
                        copy = f"{name}_{number}"
                        yield index, Instance(copy, part.mesh, file_from_mesh, file_from_copy)
                continue
            for part in parts:
                deformed = deforming.make(index, part.primitive, self.meshes[part.mesh])
                if deformed is None:
                    yield index, Instance(name, part.mesh, translate(pose, part.center), pose)
                    continue
                self.meshes.append(deformed.mesh)
                node_pose = np.eye(4) if deformed.owner is None else pose
                number = len(self.meshes) - 1
                placed = Instance(name, number, deformed.file_from_mesh, node_pose)
                yield deformed.owner, placed

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
            new_mesh, center = make_mesh(
                self._unique(name),
                material,
                positions,
                triangles,
                normals=primitive.attribute("NORMAL"),
                texture_coordinates=self._materials.uv(primitive, material),
                colors=None if colors is None else colors_rgba(colors, 1.0),
                second_texture_coordinates=self._materials.second_uv(primitive, material),
                dropped=self.dropped,
            )
            self.meshes.append(new_mesh)
            yield _Part(primitive, len(self.meshes) - 1, center)

    def _unique(self, name: str) -> str:
        """Name with a number appended if another mesh already has it."""
        unique, number = name, self._name_counts.get(name, 0)
        while unique in self._name_counts:
            number += 1
            unique = f"{name}_{number}"
        self._name_counts |= {unique: 0, name: number}
        return unique


# Features of glTF: applied, omitted with a notice, ignored or refused.
#
# `FEATURES` is the source of the notices, of the table in the documentation and of its tests.

_NEAREST = 9728  # OpenGL's constant


def feature_notices(drawn: DrawnObjects, used_extensions: Sequence[str]) -> list[str]:
    """Notices for used features that are not drawn, one line each."""
    notices = []
    for feature in FEATURES:
        if feature.support is Support.LEFT_OUT and feature.group:
            count = sum(_uses(entry, feature) for entry in drawn[feature.group])
            if count:
                noun = "node" if feature.group == "shining" else feature.group[:-1]
                notices.append(f"{feature.effect} ({counted(count, noun)})")
    noted = [
        feature for feature in FEATURES if feature.support is Support.LEFT_OUT and not feature.group
    ]
    known = {name for feature in FEATURES if feature not in noted for name in feature.extensions}
    return notices + [f"{name} is not read" for name in used_extensions if name not in known]


def _uses(entry: JsonObject, feature: Feature) -> bool:
    try:
        return feature.is_used(entry)
    except SceneError:  # a damaged value of a feature that is not read
        return True


def _differs(name: str, key: str) -> Callable[[JsonObject], bool]:
    """Predicate for materials with an extension whose factor is not 0."""
    return lambda material: material.extension_or_empty(name).number(key, 0.0) != 0.0


# Predicates for the objects of a feature's group; by default, all use it.
_USES: dict[str, Callable[[JsonObject], bool]] = {
    "mode: 0, 1, 2, 3": lambda primitive: primitive.integer("mode", TRIANGLES) in POINTS_AND_LINES,
    "JOINTS_2": lambda primitive: primitive.object("attributes").has("JOINTS_2"),
    "KHR_animation_pointer": (
        lambda channel: channel.object("target").text("path", "") == "pointer"
    ),
    "magFilter: 9728": lambda sampler: sampler.integer("magFilter", 0) == _NEAREST,
    "KHR_node_visibility": lambda node: (
        (visibility := node.extension_or_empty("KHR_node_visibility")).has("visible")
        and not visibility.flag("visible")
    ),
    "specularGlossinessTexture": lambda material: material.extension_or_empty(
        "KHR_materials_pbrSpecularGlossiness"
    ).has("specularGlossinessTexture"),
    "KHR_materials_anisotropy": _differs("KHR_materials_anisotropy", "anisotropyStrength"),
    "KHR_materials_diffuse_transmission": _differs(
        "KHR_materials_diffuse_transmission", "diffuseTransmissionFactor"
    ),
    "KHR_materials_iridescence": _differs("KHR_materials_iridescence", "iridescenceFactor"),
    "KHR_materials_sheen": lambda material: any(
        material.extension_or_empty("KHR_materials_sheen").numbers("sheenColorFactor", 3) or ()
    ),
    "transmissionTexture": has_transmission_map,
    "KHR_materials_variants": lambda primitive: (
        primitive.extension("KHR_materials_variants") is not None
    ),
}
FEATURES = tuple(
    replace(feature, is_used=_USES.get(feature.name, feature.is_used))
    for feature in feature_table("gltf")
)
# Extensions that a file may require: applied ones, and those that only change the appearance.
SUPPORTED_EXTENSIONS = frozenset(
    name
    for feature in FEATURES
    for name in feature.extensions
    if feature.support in (Support.APPLIED, Support.IGNORED)
    or (feature.support is Support.LEFT_OUT and re.match(r"[A-Z]+_(materials|lights)_", name))
)
