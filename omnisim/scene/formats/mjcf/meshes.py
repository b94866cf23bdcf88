"""Meshes of a MuJoCo model's geoms, each created once per shape and appearance."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from omnisim.core.poses import rotation_from_quaternion
from omnisim.scene.formats.imported_scene import make_mesh
from omnisim.scene.formats.mjcf.geometry import (
    Geom,
    MappedSurface,
    Shape,
    geom_shape,
    map_cube,
    map_plane,
)
from omnisim.scene.formats.mjcf.materials import Materials, Rgba, own_or_material_rgba
from omnisim.scene.parts import Mesh
from omnisim.scene.primitives import Surface

# Geoms with an inside; for meshes and height fields this is unknown.
_SOLIDS = (
    Geom.mjGEOM_PLANE, Geom.mjGEOM_SPHERE, Geom.mjGEOM_CAPSULE, Geom.mjGEOM_ELLIPSOID,
    Geom.mjGEOM_CYLINDER, Geom.mjGEOM_BOX,
)  # fmt: skip
# Mesh indices of a geom, with the mesh centers in the geom's frame.
Parts = tuple[tuple[int, NDArray[np.float64]], ...]


class Meshes:
    """Meshes of a model.

    Attributes:
        entries: meshes created so far.
        materials: materials of the meshes.
    """

    def __init__(self, model: mujoco.MjModel):
        self.entries: list[Mesh] = []
        self.materials = Materials(model)
        self._model = model
        self._shapes: dict[tuple[object, ...], Shape] = {}
        self._parts: dict[tuple[object, ...], Parts] = {}

    def rgba(self, geom: int) -> Rgba:
        """Effective color of a geom, sRGB."""
        model = self._model
        return own_or_material_rgba(model, model.geom_rgba[geom], int(model.geom_matid[geom]))

    def of_geom(self, geom: int, name: str) -> Parts:
        """Meshes of a geom, created under `name` if they are new."""
        model = self._model
        kind, material = int(model.geom_type[geom]), int(model.geom_matid[geom])
        shape_key = (kind, int(model.geom_dataid[geom]), *model.geom_size[geom].tolist())
        key = (*shape_key, material, self.rgba(geom))
        if key not in self._parts:
            if shape_key not in self._shapes:
                self._shapes[shape_key] = geom_shape(model, geom)
            mapped = self._map(self._shapes[shape_key], material, model.geom_size[geom])
            self._parts[key] = tuple(
                self._add(name, part, material, self.rgba(geom), kind) for part in mapped
            )
        return self._parts[key]

    def add(self, name: str, mapped: MappedSurface, material: int, rgba: Rgba) -> Parts:
        """Double-sided meshes of skins and flexible bodies."""
        return (self._add(name, mapped, material, rgba, None),)

    def _map(self, shape: Shape, material: int, sizes: NDArray[np.float64]) -> list[MappedSurface]:
        """Parts of a shape, with texture coordinates if the material has a texture."""
        model = self._model
        texture = self.materials.color_texture(material)
        plain = MappedSurface(None, shape.surface, shape.texture_coordinates)
        if texture is None:
            return [plain]
        is_uniform = bool(model.mat_texuniform[material])
        if not self.materials.textures.is_cube(texture):
            if shape.texture_coordinates is not None:
                return [plain]
            return [map_plane(shape, model.mat_texrepeat[material], sizes, is_uniform)]
        if self.materials.textures.plain_color(texture) is not None:
            return [plain]
        return map_cube(shape, sizes, is_uniform)

    def _add(
        self, name: str, mapped: MappedSurface, material: int, rgba: Rgba, kind: int | None
    ) -> tuple[int, NDArray[np.float64]]:
        surface = mapped.surface
        index = self.materials.index(
            material, rgba, mapped.face, kind in _SOLIDS, kind == Geom.mjGEOM_PLANE
        )
        mesh, center = make_mesh(
            name,
            surface.positions,
            surface.triangles,
            index,
            surface.normals,
            mapped.texture_coordinates,
        )
        self.entries.append(mesh)
        return len(self.entries) - 1, center


# Skins and flexible bodies of a MuJoCo model, in their current state.


class Deformable(NamedTuple):
    """Skin or flexible body.

    Attributes:
        name: name of the element.
        mapped: surface, world frame.
        material: material index in the model; −1: none.
        rgba: effective color.
        group: visibility group.
    """

    name: str
    mapped: MappedSurface
    material: int
    rgba: Rgba
    group: int


def visible_deformables(
    model: mujoco.MjModel, data: mujoco.MjData, groups: Collection[int]
) -> list[Deformable]:
    """Skins and flexible bodies of the given groups that have a surface."""
    every = (*_skins(model, data), *_flexes(model, data))
    return [one for one in every if one.group in groups and len(one.mapped.surface.triangles)]


def _skins(model: mujoco.MjModel, data: mujoco.MjData) -> Iterator[Deformable]:
    """Skins, deformed by their bones."""
    for skin in range(model.nskin):
        material = int(model.skin_matid[skin])
        first, count = int(model.skin_vertadr[skin]), int(model.skin_vertnum[skin])
        face, faces = int(model.skin_faceadr[skin]), int(model.skin_facenum[skin])
        coordinates = None
        if int(model.skin_texcoordadr[skin]) >= 0:
            start = int(model.skin_texcoordadr[skin])
            coordinates = model.skin_texcoord[start : start + count].astype(np.float64)
        positions = _skinned(model, data, skin, model.skin_vert[first : first + count])
        triangles = model.skin_face[face : face + faces].astype(np.int64)
        normals = _vertex_normals(positions, triangles)
        positions = positions + float(model.skin_inflate[skin]) * normals
        yield Deformable(
            mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_SKIN, skin) or f"skin_{skin}",
            MappedSurface(None, Surface(positions, triangles, normals), coordinates),
            material,
            own_or_material_rgba(model, model.skin_rgba[skin], material),
            int(model.skin_group[skin]),
        )


def _flexes(model: mujoco.MjModel, data: mujoco.MjData) -> Iterator[Deformable]:
    """Flexible bodies: cloths and the shells of solids; ropes have no surface."""
    for flex in range(model.nflex):
        dimension = int(model.flex_dim[flex])
        if dimension == 1:
            continue
        if dimension == 2:
            start, count = int(model.flex_elemdataadr[flex]), int(model.flex_elemnum[flex])
            flat = model.flex_elem
        else:
            start, count = int(model.flex_shelldataadr[flex]), int(model.flex_shellnum[flex])
            flat = model.flex_shell
        triangles = flat[start : start + 3 * count].reshape(-1, 3).astype(np.int64)
        first = int(model.flex_vertadr[flex])
        positions = data.flexvert_xpos[first : first + int(model.flex_vertnum[flex])].copy()
        material = int(model.flex_matid[flex])
        yield Deformable(
            mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_FLEX, flex) or f"flex_{flex}",
            MappedSurface(
                None, Surface(positions, triangles, _vertex_normals(positions, triangles)), None
            ),
            material,
            own_or_material_rgba(model, model.flex_rgba[flex], material),
            int(model.flex_group[flex]),
        )


def _skinned(
    model: mujoco.MjModel, data: mujoco.MjData, skin: int, rest: NDArray[np.float32]
) -> NDArray[np.float64]:
    """Positions (n, 3) of a skin's vertices, as weighted means of their bones' transforms.

    Source: linear blend skinning, as MuJoCo's mjv_updateSkin.
    """
    start, count = int(model.skin_boneadr[skin]), int(model.skin_bonenum[skin])
    positions = np.zeros(rest.shape)
    for bone in range(start, start + count):
        body = int(model.skin_bonebodyid[bone])
        w, x, y, z = model.skin_bonebindquat[bone].tolist()
        (body_from_bind,) = rotation_from_quaternion([(x, y, z, w)])
        rotation = data.xmat[body].reshape(3, 3) @ body_from_bind.T
        shift = data.xpos[body] - rotation @ model.skin_bonebindpos[bone]
        first = int(model.skin_bonevertadr[bone])
        own = slice(first, first + int(model.skin_bonevertnum[bone]))
        vertices = model.skin_bonevertid[own]
        moved = rest[vertices] @ rotation.T + shift
        np.add.at(positions, vertices, model.skin_bonevertweight[own, None] * moved)
    return positions


def _vertex_normals(
    positions: NDArray[np.float64], triangles: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Unit normals (n, 3), area-weighted over the triangles around each vertex."""
    corners = positions[triangles]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros(positions.shape)
    for corner in range(3):
        np.add.at(normals, triangles[:, corner], across)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.where(lengths > 0.0, normals / np.where(lengths > 0.0, lengths, 1.0), (0.0, 0.0, 1.0))
