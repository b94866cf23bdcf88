"""Edits of a scene's content: add, remove, move and recolor instances.

An instance consists of all parts with the same name, as in the ground truth. Content is never
changed in place: an edit returns new content that shares all unchanged arrays, so that a stage
uploads only the changes.
"""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from omnisim.core.errors import SceneError, did_you_mean
from omnisim.core.poses import inverse, is_pose
from omnisim.scene.arrays import color_material, instance_pose
from omnisim.scene.parts import Instance, Material, Mesh


class Content(NamedTuple):
    """Meshes, materials and instances of a scene."""

    meshes: tuple[Mesh, ...]
    materials: tuple[Material, ...]
    instances: tuple[Instance, ...]


def find(content: Content, name: str) -> tuple[Instance, ...]:
    """Parts of an instance, by its name.

    Raises:
        SceneError: unknown instance.
    """
    parts = tuple(one for one in content.instances if one.name == name)
    if not parts:
        names = dict.fromkeys(one.name for one in content.instances)
        hint = did_you_mean(str(name), names, "the scene has")
        raise SceneError(f"instance {name!r}: unknown; {hint}")
    return parts


def pose_of(content: Content, name: str) -> NDArray[np.float64]:
    """Pose (4, 4) of an instance's frame, without the scale of its node.

    Raises:
        SceneError: unknown instance.
    """
    node = find(content, name)[0].world_from_node
    if is_pose(node):
        return node.copy()
    pose = np.eye(4)
    left, _, right = np.linalg.svd(node[:3, :3])
    left[:, 2] *= np.sign(
        np.linalg.det(left @ right)
    )  # the nearest rotation, also for a mirrored frame
    pose[:3, :3], pose[:3, 3] = left @ right, node[:3, 3]
    return pose


def move(content: Content, name: str, world_from_instance: ArrayLike) -> Content:
    """Move an instance's frame to a pose (4, 4).

    Raises:
        SceneError: an unknown instance or an invalid pose.
    """
    before = pose_of(content, name)
    displacement = instance_pose(name, world_from_instance) @ inverse(before)
    moved = tuple(
        dataclasses.replace(
            one,
            world_from_mesh=displacement @ one.world_from_mesh,
            world_from_node=displacement @ one.world_from_node,
            light_rectangle=None,  # baked for the previous pose
            light_back_rectangle=None,
        )
        if one.name == name
        else one
        for one in content.instances
    )
    return content._replace(instances=moved)


def add(content: Content, name: str, part: Content, world_from_part: ArrayLike) -> Content:
    """Add all instances of other content as one instance.

    Raises:
        SceneError: an empty name, an existing name or an invalid pose.
    """
    if not isinstance(name, str) or not name:
        raise SceneError(f"instance: expected a name, got {name!r}")
    if any(one.name == name for one in content.instances):
        raise SceneError(f"instance {name!r}: expected a new name, got that of another instance")
    pose = instance_pose(name, world_from_part)
    meshes, materials = list(content.meshes), list(content.materials)
    # meshes and materials that other instances already have are shared
    mesh_at = {_geometry(mesh, content.materials): i for i, mesh in enumerate(meshes)}
    material_at = {id(material): i for i, material in enumerate(materials)}
    instances = list(content.instances)
    for one in part.instances:
        mesh = part.meshes[one.mesh]
        key, material = _geometry(mesh, part.materials), part.materials[mesh.material]
        if key not in mesh_at:
            if id(material) not in material_at:
                material_at[id(material)] = len(materials)
                materials.append(material)
            mesh_at[key] = len(meshes)
            meshes.append(dataclasses.replace(mesh, material=material_at[id(material)]))
        instances.append(Instance(name, mesh_at[key], pose @ one.world_from_mesh, pose))
    return Content(tuple(meshes), tuple(materials), tuple(instances))


def free_name(content: Content, name: str) -> str:
    """Name with underscores appended until no instance has it."""
    used_names = {one.name for one in content.instances}
    while name in used_names:
        name += "_"
    return name


def remove(content: Content, name: str) -> Content:
    """Remove an instance.

    Raises:
        SceneError: unknown instance.
    """
    find(content, name)
    kept = tuple(one for one in content.instances if one.name != name)
    return _without_unused(content, content._replace(instances=kept))


def recolor(
    content: Content, name: str, base_color: ArrayLike, texture: ArrayLike | None
) -> Content:
    """Replace an instance's appearance by a color, or by a texture times a color.

    Raises:
        SceneError: an unknown instance, or an invalid color or texture.
    """
    meshes, materials = list(content.meshes), list(content.materials)
    mesh_at: dict[int, int] = {}
    material_at: dict[int, int] = {}
    for number in dict.fromkeys(one.mesh for one in find(content, name)):
        mesh = meshes[number]
        if texture is not None and mesh.texture_coordinates is None:
            raise SceneError(
                f"instance {name!r}: texture: expected texture coordinates in mesh {mesh.name!r}"
            )
        if mesh.material not in material_at:
            like = content.materials[mesh.material]
            material_at[mesh.material] = len(materials)
            materials.append(color_material(name, base_color, texture, like))
        mesh_at[number] = len(meshes)
        meshes.append(dataclasses.replace(mesh, material=material_at[mesh.material], colors=None))
    instances = tuple(
        dataclasses.replace(one, mesh=mesh_at[one.mesh]) if one.name == name else one
        for one in content.instances
    )
    return _without_unused(content, Content(tuple(meshes), tuple(materials), instances))


def _geometry(mesh: Mesh, materials: tuple[Material, ...]) -> tuple[int, ...]:
    """Identity of a mesh: the IDs of its arrays and of its material."""
    arrays = (mesh.positions, mesh.triangles, mesh.normals, mesh.texture_coordinates, mesh.colors)
    return (*map(id, arrays), id(materials[mesh.material]))


def _without_unused(before: Content, after: Content) -> Content:
    """Edited content without the meshes and materials that only the edited instance used."""
    lost = {one.mesh for one in before.instances} - {one.mesh for one in after.instances}
    if not lost:
        return after
    meshes = [mesh for i, mesh in enumerate(after.meshes) if i not in lost]
    orphaned = {after.meshes[i].material for i in lost} - {mesh.material for mesh in meshes}
    mesh_at = _renumbered(len(after.meshes), lost)
    material_at = _renumbered(len(after.materials), orphaned)
    return Content(
        tuple(dataclasses.replace(one, material=material_at[one.material]) for one in meshes)
        if orphaned
        else tuple(meshes),
        tuple(one for i, one in enumerate(after.materials) if i not in orphaned),
        tuple(dataclasses.replace(one, mesh=mesh_at[one.mesh]) for one in after.instances),
    )


def _renumbered(count: int, dropped: set[int]) -> list[int]:
    """New index of each item once the dropped ones are removed."""
    kept = np.ones(count, dtype=np.int64)
    kept[list(dropped)] = 0
    return (np.cumsum(kept) - kept).tolist()
