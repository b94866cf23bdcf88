"""Content of a scene made from arrays, and its edits: add, remove, move and recolor instances.

An instance consists of all parts with the same name, as in the ground truth. Content is never
changed in place: an edit returns new content that shares all unchanged arrays, so that a stage
uploads only the changes. Errors are SceneErrors that name the instance, the expected and the actual
value.
"""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from omnisim.core.arrays import Floats
from omnisim.core.errors import OmnisimError, SceneError, did_you_mean
from omnisim.core.poses import check_pose, inverse, is_pose, pose_from_rotation
from omnisim.core.srgb import linear_from_srgb8
from omnisim.scene.formats.imported_scene import PLAIN_GRAY, ImportedScene, make_mesh
from omnisim.scene.parts import AlphaMode, Instance, Material, Mesh, Texture


class Content(NamedTuple):
    """Meshes, materials and instances of a scene."""

    meshes: tuple[Mesh, ...]
    materials: tuple[Material, ...]
    instances: tuple[Instance, ...]


def find(content: Content, name: str) -> tuple[Instance, ...]:
    """Parts of an instance, by its name."""
    parts = tuple(instance for instance in content.instances if instance.name == name)
    if not parts:
        names = dict.fromkeys(instance.name for instance in content.instances)
        hint = did_you_mean(str(name), names, "the scene has")
        raise _error(name, f"unknown; {hint}")
    return parts


def pose_of(content: Content, name: str) -> Floats:
    """Pose (4, 4) of an instance's frame, without the scale of its node."""
    node = find(content, name)[0].world_from_node
    if is_pose(node):
        return node.copy()
    left, _, right = np.linalg.svd(node[:3, :3])
    # the nearest rotation, also for a mirrored frame
    left[:, 2] *= np.sign(np.linalg.det(left @ right))
    return pose_from_rotation(left @ right, node[:3, 3])


def move(content: Content, name: str, world_from_instance: ArrayLike) -> Content:
    """Move an instance's frame to a pose (4, 4)."""
    before = pose_of(content, name)
    displacement = instance_pose(name, world_from_instance) @ inverse(before)
    moved = tuple(
        dataclasses.replace(
            instance,
            world_from_mesh=displacement @ instance.world_from_mesh,
            world_from_node=displacement @ instance.world_from_node,
            light_rectangle=None,  # baked for the previous pose
            light_back_rectangle=None,
        )
        if instance.name == name
        else instance
        for instance in content.instances
    )
    return content._replace(instances=moved)


def add(content: Content, name: str, part: Content, world_from_part: ArrayLike) -> Content:
    """Add all instances of other content as one instance."""
    if not isinstance(name, str) or not name:
        raise SceneError(f"instance: expected a name, got {name!r}")
    if any(instance.name == name for instance in content.instances):
        raise _error(name, "expected a new name, got that of another instance")
    pose = instance_pose(name, world_from_part)
    meshes, materials = list(content.meshes), list(content.materials)
    # meshes and materials that other instances already have are shared
    mesh_at = {_geometry(mesh, content.materials): i for i, mesh in enumerate(meshes)}
    material_at = {id(material): i for i, material in enumerate(materials)}
    instances = list(content.instances)
    for instance in part.instances:
        mesh = part.meshes[instance.mesh]
        key, material = _geometry(mesh, part.materials), part.materials[mesh.material]
        if key not in mesh_at:
            if id(material) not in material_at:
                material_at[id(material)] = len(materials)
                materials.append(material)
            mesh_at[key] = len(meshes)
            meshes.append(dataclasses.replace(mesh, material=material_at[id(material)]))
        instances.append(Instance(name, mesh_at[key], pose @ instance.world_from_mesh, pose))
    return Content(tuple(meshes), tuple(materials), tuple(instances))


def free_name(content: Content, name: str) -> str:
    """Name with underscores appended until no instance has it."""
    used_names = {instance.name for instance in content.instances}
    while name in used_names:
        name += "_"
    return name


def remove(content: Content, name: str) -> Content:
    """Remove an instance."""
    find(content, name)
    kept = tuple(instance for instance in content.instances if instance.name != name)
    return _without_unused(content, content._replace(instances=kept))


def recolor(
    content: Content, name: str, base_color: ArrayLike, texture: ArrayLike | None
) -> Content:
    """Replace an instance's appearance by a color, or by a texture times a color."""
    meshes, materials = list(content.meshes), list(content.materials)
    mesh_at: dict[int, int] = {}
    material_at: dict[int, int] = {}
    for number in dict.fromkeys(instance.mesh for instance in find(content, name)):
        mesh = meshes[number]
        if texture is not None and mesh.texture_coordinates is None:
            raise _error(name, f"texture: expected texture coordinates in mesh {mesh.name!r}")
        if mesh.material not in material_at:
            like = content.materials[mesh.material]
            material_at[mesh.material] = len(materials)
            materials.append(color_material(name, base_color, texture, like))
        mesh_at[number] = len(meshes)
        meshes.append(dataclasses.replace(mesh, material=material_at[mesh.material], colors=None))
    instances = tuple(
        dataclasses.replace(instance, mesh=mesh_at[instance.mesh])
        if instance.name == name
        else instance
        for instance in content.instances
    )
    return _without_unused(content, Content(tuple(meshes), tuple(materials), instances))


def _geometry(mesh: Mesh, materials: tuple[Material, ...]) -> tuple[int, ...]:
    """Identity of a mesh: the IDs of its arrays and of its material."""
    arrays = (mesh.positions, mesh.triangles, mesh.normals, mesh.texture_coordinates, mesh.colors)
    return (*map(id, arrays), id(materials[mesh.material]))


def _without_unused(before: Content, after: Content) -> Content:
    """Edited content without the meshes and materials that only the edited instance used."""
    lost = {instance.mesh for instance in before.instances} - {
        instance.mesh for instance in after.instances
    }
    if not lost:
        return after
    meshes = [mesh for i, mesh in enumerate(after.meshes) if i not in lost]
    orphaned = {after.meshes[i].material for i in lost} - {mesh.material for mesh in meshes}
    mesh_at = _renumbered(len(after.meshes), lost)
    material_at = _renumbered(len(after.materials), orphaned)
    return Content(
        tuple(dataclasses.replace(mesh, material=material_at[mesh.material]) for mesh in meshes)
        if orphaned
        else tuple(meshes),
        tuple(material for i, material in enumerate(after.materials) if i not in orphaned),
        tuple(
            dataclasses.replace(instance, mesh=mesh_at[instance.mesh])
            for instance in after.instances
        ),
    )


def _renumbered(count: int, dropped: set[int]) -> list[int]:
    """New index of each item once the dropped ones are removed."""
    kept = np.ones(count, dtype=np.int64)
    kept[list(dropped)] = 0
    return (np.cumsum(kept) - kept).tolist()


# Validation of arrays passed from Python, and the meshes and materials made from them.

_BYTE = np.dtype(np.uint8)


def import_arrays(
    name: str,
    vertices_m: ArrayLike,
    triangles: ArrayLike,
    normals: ArrayLike | None,
    uv: ArrayLike | None,
    colors: ArrayLike | None,
    texture: ArrayLike | None,
    base_color: ArrayLike | None,
    double_sided: bool,
) -> ImportedScene:
    """Import one instance; the arguments are those of `Scene.from_arrays`."""
    vertices = _numbers(name, "vertices_m", vertices_m, ("n", 3))
    corners = _numbers(name, "triangles", triangles, ("m", 3))
    if not (len(corners) and (corners == np.floor(corners)).all()):
        raise _error(name, "triangles: expected whole numbers (m, 3), m ≥ 1")
    count = len(vertices)
    coordinates = None if uv is None else _numbers(name, "uv", uv, (count, 2))
    if texture is not None and coordinates is None:
        raise _error(name, "texture: expected uv with it, got none")
    mesh, center = make_mesh(
        name,
        0,
        vertices,
        corners,
        None if normals is None else _numbers(name, "normals", normals, (count, 3)),
        coordinates,
        None if colors is None else _vertex_colors(name, colors, count),
    )
    if base_color is None:
        is_plain = colors is None and texture is None
        base_color = [PLAIN_GRAY if is_plain else 1.0] * 3
    like = Material(name, double_sided=double_sided)
    material = color_material(name, base_color, texture, like)
    world_from_mesh = np.eye(4)
    world_from_mesh[:3, 3] = center
    return ImportedScene((mesh,), (material,), (Instance(name, 0, world_from_mesh),), [])


def color_material(
    name: str, base_color: ArrayLike, texture: ArrayLike | None, like: Material
) -> Material:
    """Material of a linear RGB or RGBA color from 0 to 1, multiplied by a texture.

    The texture (height, width, 3 or 4) is uint8 sRGB. `like` supplies the name, `double_sided` and
    `unlit`; errors name the instance.
    """
    rgba = _numbers(name, "base_color", base_color, None)
    if rgba.shape not in ((3,), (4,)) or rgba.min() < 0.0 or rgba.max() > 1.0:
        raise _error(
            name, f"base_color: expected three or four numbers from 0 to 1, got {rgba.tolist()}"
        )
    red, green, blue, alpha = (*rgba.tolist(), 1.0)[:4]
    image = None if texture is None else _texture(name, texture)
    mode = AlphaMode.BLEND
    if alpha == 1.0:
        from omnisim.scene.textures import alpha_mode_of  # with Pillow, slow to import

        mode = alpha_mode_of(image)
    return Material(
        like.name,
        (red, green, blue, alpha),
        image,
        mode,
        double_sided=like.double_sided,
        unlit=like.unlit,
    )


def instance_pose(name: str, matrix: ArrayLike) -> Floats:
    """Checked pose (4, 4) of an instance."""
    checked = _numbers(name, "pose", matrix, (4, 4))
    try:
        return check_pose(checked)
    except OmnisimError as reason:
        raise _error(name, f"{reason}") from None


def _texture(name: str, texture: ArrayLike) -> Texture:
    pixels = np.asarray(texture)
    is_image = pixels.ndim == 3 and pixels.shape[2] in (3, 4) and pixels.size
    if pixels.dtype != _BYTE or not is_image:
        raise _error(
            name,
            f"texture: expected (height, width, 3 or 4) uint8, got {pixels.shape} {pixels.dtype}",
        )
    rgba = np.full((*pixels.shape[:2], 4), 255, dtype=np.uint8)
    rgba[..., : pixels.shape[2]] = pixels
    return Texture(rgba)


def _vertex_colors(name: str, colors: ArrayLike, count: int) -> Floats:
    """Linear RGBA (n, 4) from sRGB bytes or from linear numbers in [0, 1]."""
    width = 4 if np.shape(colors)[-1:] == (4,) else 3
    values = _numbers(name, "colors", colors, (count, width))
    if np.asarray(colors).dtype == _BYTE:
        values = np.concatenate(
            (linear_from_srgb8(np.asarray(colors)[:, :3]), values[:, 3:] / 255.0), axis=1
        )
    if values.size and (values.min() < 0.0 or values.max() > 1.0):
        raise _error(
            name,
            f"colors: expected uint8, or numbers from 0 to 1, "
            f"got {values.min():g} to {values.max():g}",
        )
    rgba = np.ones((count, 4))
    rgba[:, :width] = values
    return rgba


def _numbers(name: str, key: str, values: ArrayLike, shape: tuple[str | int, ...] | None) -> Floats:
    """Validated array of finite numbers; a letter in `shape` means any length."""
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise _error(name, f"{key}: expected numbers, got {values!r:.40}") from None
    if shape is not None and (
        array.ndim != len(shape)
        or any(got != n for got, n in zip(array.shape, shape, strict=True) if isinstance(n, int))
    ):
        expected = "(" + ", ".join(map(str, shape)) + ")"
        raise _error(name, f"{key}: expected {expected}, got {array.shape}")
    if not np.isfinite(array).all():
        raise _error(name, f"{key}: expected finite numbers, got NaN or infinity")
    return array


def _error(name: str, fault: str) -> SceneError:
    return SceneError(f"instance {name!r}: {fault}")
