"""Meshes of a MuJoCo model's geoms, each created once per shape and appearance."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Floats, Floats32, Ints
from omnisim.core.errors import SceneError
from omnisim.core.poses import rotation_from_quaternion
from omnisim.scene.formats.imported_scene import make_mesh
from omnisim.scene.formats.mjcf.materials import ModelMaterials, Rgba, own_or_material_rgba
from omnisim.scene.parts import Mesh
from omnisim.scene.primitives import (
    PrimitiveSurface,
    box,
    capsule,
    cylinder,
    ellipsoid,
    grid_triangles,
    join,
    rectangle,
    segments,
)

Geom = mujoco.mjtGeom
# Geoms with an inside; for meshes and height fields this is unknown.
_SOLIDS = (
    Geom.mjGEOM_PLANE, Geom.mjGEOM_SPHERE, Geom.mjGEOM_CAPSULE, Geom.mjGEOM_ELLIPSOID,
    Geom.mjGEOM_CYLINDER, Geom.mjGEOM_BOX,
)  # fmt: skip
# Mesh indices of a geom, with the mesh centers in the geom's frame.
Parts = tuple[tuple[int, Floats], ...]


class Meshes:
    """Meshes of a model, those created so far, and their materials."""

    def __init__(self, model: mujoco.MjModel):
        self.entries: list[Mesh] = []
        self.materials = ModelMaterials(model)
        self._model = model
        self._shapes: dict[tuple[object, ...], GeomShape] = {}
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
                self.add(name, part, material, self.rgba(geom), kind) for part in mapped
            )
        return self._parts[key]

    def _map(self, shape: GeomShape, material: int, sizes: Floats) -> list[MappedSurface]:
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

    def add(
        self, name: str, mapped: MappedSurface, material: int, rgba: Rgba, kind: int | None = None
    ) -> tuple[int, Floats]:
        """Mesh of a geom of a kind, or of a skin or flexible body, which is double-sided."""
        index = self.materials.index(
            material, rgba, mapped.face, kind in _SOLIDS, kind == Geom.mjGEOM_PLANE
        )
        mesh, center = make_mesh(name, index, *mapped.surface, mapped.texture_coordinates)
        self.entries.append(mesh)
        return len(self.entries) - 1, center


# Skins and flexible bodies of a MuJoCo model, in their current state.


class Deformable(NamedTuple):
    """Skin or flexible body."""

    name: str  # name of the element
    mapped: MappedSurface  # surface, world frame
    material: int  # material index in the model; −1: none
    rgba: Rgba  # effective color
    group: int  # visibility group


def visible_deformables(
    model: mujoco.MjModel, data: mujoco.MjData, groups: Collection[int]
) -> list[Deformable]:
    """Skins and flexible bodies of the given groups that have a surface."""
    every = (*_skins(model, data), *_flexes(model, data))
    return [
        deformable
        for deformable in every
        if deformable.group in groups and len(deformable.mapped.surface.triangles)
    ]


def _skins(model: mujoco.MjModel, data: mujoco.MjData) -> Iterator[Deformable]:
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
            MappedSurface(None, PrimitiveSurface(positions, triangles, normals), coordinates),
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
                None,
                PrimitiveSurface(positions, triangles, _vertex_normals(positions, triangles)),
                None,
            ),
            material,
            own_or_material_rgba(model, model.flex_rgba[flex], material),
            int(model.flex_group[flex]),
        )


def _skinned(model: mujoco.MjModel, data: mujoco.MjData, skin: int, rest: Floats32) -> Floats:
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


def _vertex_normals(positions: Floats, triangles: Ints) -> Floats:
    """Unit normals (n, 3), area-weighted over the triangles around each vertex."""
    corners = positions[triangles]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros(positions.shape)
    for corner in range(3):
        np.add.at(normals, triangles[:, corner], across)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.where(lengths > 0.0, normals / np.where(lengths > 0.0, lengths, 1.0), (0.0, 0.0, 1.0))


# Triangles of a MuJoCo model's geoms, each in its geom's frame.

# Minimum half size of an infinite plane, which otherwise reaches MuJoCo's far clipping plane.
MIN_REACH_M = 100.0


class GeomShape(NamedTuple):
    """Surface of a geom, with the inputs of texture mapping."""

    surface: PrimitiveSurface  # triangles, m
    texture_coordinates: Floats | None  # (n, 2) from the mesh file; None: not in the file
    # (n, 3) positions divided by the geom's sizes, as MuJoCo's renderer scales its built-in shapes;
    # they map textures without coordinates
    scaled: Floats


def geom_shape(model: mujoco.MjModel, geom: int) -> GeomShape:
    """Shape of a geom; a signed distance field takes the shape of its mesh."""
    kind, size = Geom(int(model.geom_type[geom])), model.geom_size[geom]
    if not np.isfinite(size).all():
        name = model.geom(geom).name or str(geom)
        raise SceneError(f"geom {name}: size: expected finite numbers, got {size.tolist()}")
    data = int(model.geom_dataid[geom])
    if kind in (Geom.mjGEOM_MESH, Geom.mjGEOM_SDF):
        surface, coordinates = _mesh(model, data)
        return _of_sizes(surface, size, coordinates)
    if kind == Geom.mjGEOM_HFIELD:
        return _of_sizes(_height_field(model, data), model.hfield_size[data][:3])
    if kind == Geom.mjGEOM_PLANE:
        reach_m = max(float(model.vis.map.zfar * model.stat.extent), MIN_REACH_M)
        half_sizes = (float(half) if half > 0.0 else reach_m for half in size[:2])
        return _of_sizes(rectangle(*half_sizes), size)
    return _PRIMITIVES[kind](size)


def _of_sizes(
    surface: PrimitiveSurface, sizes: Floats, coordinates: Floats | None = None
) -> GeomShape:
    """Shape whose positions are divided by sizes (3,); those of 0 count as 1."""
    return GeomShape(surface, coordinates, surface.positions / np.where(sizes > 0.0, sizes, 1.0))


def _capsule(size: Floats) -> GeomShape:
    """Capsule, with hemispheres scaled by the radius, measured from the ends of the tube."""
    radius, half = float(size[0]), float(size[1])
    surface = capsule(radius, half)
    scaled = surface.positions / (radius, radius, half)
    domes = slice(2 * (segments(radius) + 1), None)  # vertices after those of the tube
    z = surface.positions[domes, 2]
    scaled[domes, 2] = np.sign(z) * (1.0 + (np.abs(z) - half) / radius)
    return GeomShape(surface, None, scaled)


_PRIMITIVES: dict[mujoco.mjtGeom, Callable[[Floats], GeomShape]] = {
    Geom.mjGEOM_SPHERE: lambda size: _of_sizes(ellipsoid(size[[0, 0, 0]]), size[[0, 0, 0]]),
    Geom.mjGEOM_ELLIPSOID: lambda size: _of_sizes(ellipsoid(size), size),
    Geom.mjGEOM_CYLINDER: lambda size: _of_sizes(
        cylinder(float(size[0]), float(size[1])), size[[0, 0, 1]]
    ),
    Geom.mjGEOM_BOX: lambda size: _of_sizes(box(size), size),
    Geom.mjGEOM_CAPSULE: _capsule,
}


def _mesh(model: mujoco.MjModel, mesh: int) -> tuple[PrimitiveSurface, Floats | None]:
    """Surface and texture coordinates (n, 2) of a mesh, whose faces index both separately."""
    faces = slice(
        int(model.mesh_faceadr[mesh]), int(model.mesh_faceadr[mesh] + model.mesh_facenum[mesh])
    )
    positions = _rows(model.mesh_vert, model.mesh_vertadr, model.mesh_vertnum, mesh)
    normals = _rows(model.mesh_normal, model.mesh_normaladr, model.mesh_normalnum, mesh)
    corners = [model.mesh_face[faces].ravel(), model.mesh_facenormal[faces].ravel()]
    coordinates = None
    if int(model.mesh_texcoordadr[mesh]) >= 0:
        coordinates = _rows(
            model.mesh_texcoord, model.mesh_texcoordadr, model.mesh_texcoordnum, mesh
        )
        corners.append(model.mesh_facetexcoord[faces].ravel())
    vertices, triangles = np.unique(np.stack(corners, axis=1), axis=0, return_inverse=True)
    surface = PrimitiveSurface(
        positions[vertices[:, 0]],
        triangles.reshape(-1, 3).astype(np.int64),
        normals[vertices[:, 1]],
    )
    return surface, None if coordinates is None else coordinates[vertices[:, 2]]


def _rows(
    values: Floats32, starts: NDArray[np.int32], counts: NDArray[np.int32], index: int
) -> Floats:
    start = int(starts[index])
    return values[start : start + int(counts[index])].astype(np.float64)


def _height_field(model: mujoco.MjModel, field: int) -> PrimitiveSurface:
    rows, columns = int(model.hfield_nrow[field]), int(model.hfield_ncol[field])
    half_x, half_y, top, base = (float(size) for size in model.hfield_size[field])
    start = int(model.hfield_adr[field])
    heights = model.hfield_data[start : start + rows * columns].reshape(rows, columns)
    x = np.linspace(-half_x, half_x, columns)
    y = np.linspace(-half_y, half_y, rows)
    positions = np.stack(
        np.broadcast_arrays(x, y[:, None], heights.astype(np.float64) * top), axis=-1
    )
    edges = (positions[0], positions[:, -1], positions[-1, ::-1], positions[::-1, 0])
    sides = []
    for edge in edges:
        rim = np.concatenate((np.column_stack((edge[:, :2], np.full(len(edge), -base))), edge))
        sides.append(PrimitiveSurface(rim, grid_triangles(2, len(edge)), None))
    bottom = rectangle(half_x, half_y)
    return join(
        PrimitiveSurface(positions.reshape(-1, 3), grid_triangles(rows, columns), None),
        *sides,
        PrimitiveSurface(bottom.positions - (0.0, 0.0, base), bottom.triangles[:, ::-1], None),
    )


# Texture coordinates for geoms without their own, matching MuJoCo's renderer.
#
# A flat image is projected along z, a cube texture from the geom's center.
#
# Source: MuJoCo, render_gl3.c, settexture (object-linear texture coordinates); OpenGL 4.6, table
# 8.19 (faces of a cube).

# Axis of each cube face, and the axes and signs of right and down in its image.
_FACES = (
    (0, 1.0, (2, -1.0), (1, -1.0)),
    (0, -1.0, (2, 1.0), (1, -1.0)),
    (1, 1.0, (0, 1.0), (2, 1.0)),
    (1, -1.0, (0, 1.0), (2, -1.0)),
    (2, 1.0, (0, 1.0), (1, -1.0)),
    (2, -1.0, (0, -1.0), (1, -1.0)),
)
_EDGES = np.array([(1.0, -1, 0), (1, 1, 0), (1, 0, -1), (1, 0, 1), (0, 1, -1), (0, 1, 1)])


class MappedSurface(NamedTuple):
    """Part of a surface with texture coordinates."""

    face: int | None  # face of the cube; None: a flat image
    surface: PrimitiveSurface
    texture_coordinates: Floats | None


def map_plane(shape: GeomShape, repeat: Floats32, sizes: Floats, is_uniform: bool) -> MappedSurface:
    """Texture coordinates of an image projected along z.

    The image repeats across the geom along x and y or, if it `is_uniform`, across 2 m.
    """
    scale = np.asarray(repeat, dtype=np.float64)
    if is_uniform:
        scale = scale * np.where(sizes[:2] > 0.0, sizes[:2], 1.0)
    return MappedSurface(None, shape.surface, shape.scaled[:, :2] * scale * (0.5, -0.5) - 0.5)


def map_cube(shape: GeomShape, sizes: Floats, is_uniform: bool) -> list[MappedSurface]:
    """Texture coordinates of a cube projected from the center; triangles are cut at its edges.

    It projects positions in meters if it `is_uniform`, else positions divided by the sizes (3,).
    """
    ray = shape.scaled * np.where(sizes > 0.0, sizes, 1.0) if is_uniform else shape.scaled
    surface = shape.surface
    has_normals = surface.normals is not None
    columns = [surface.positions, ray] + ([surface.normals] if surface.normals is not None else [])
    corners = np.concatenate(columns, axis=1)[surface.triangles]
    for edge in _EDGES:
        reach = np.abs(corners[:, :, 3:6]).max(axis=2, keepdims=True) * (1.0 - 1e-9)
        is_far = np.concatenate((corners[:, :, 3:6] >= reach, corners[:, :, 3:6] <= -reach), axis=2)
        is_done = is_far.sum(axis=1).max(axis=1, initial=0) == 3  # all corners on one face
        rest = corners[~is_done]
        corners = np.concatenate((corners[is_done], _cut(rest, rest[:, :, 3:6] @ edge)))
    middles = corners[:, :, 3:6].sum(axis=1)
    axis = np.argmax(np.abs(middles), axis=1)
    sign = np.where(np.take_along_axis(middles, axis[:, None], 1)[:, 0] < 0.0, -1.0, 1.0)
    mapped = []
    for face, (of_axis, of_sign, right, down) in enumerate(_FACES):
        part = corners[(axis == of_axis) & (sign == of_sign)].reshape(-1, corners.shape[2])
        if not len(part):
            continue
        rays = part[:, 3:6]
        depth = np.maximum(np.abs(rays[:, of_axis]), 1e-12)
        places = [rays[:, k] * s / depth for k, s in (right, down)]
        mapped.append(
            MappedSurface(
                face,
                PrimitiveSurface(
                    part[:, :3],
                    np.arange(len(part)).reshape(-1, 3),
                    part[:, 6:] if has_normals else None,
                ),
                0.5 * np.clip(np.stack(places, axis=1), -1.0, 1.0) + 0.5,
            )
        )
    return mapped


def _cut(corners: Floats, sides: Floats) -> Floats:
    """Cut triangles (m, 3, k) where a value (m, 3) given at their corners changes sign."""
    level = np.abs(sides).max(initial=0.0) * 1e-9
    sides = np.where(np.abs(sides) <= level, 0.0, sides)
    is_cut = (sides.min(axis=1) < 0.0) & (sides.max(axis=1) > 0.0)
    if not is_cut.any():
        return corners
    tri, side = corners[is_cut], sides[is_cut]
    # Rotates the corner alone on its side to the front; if one is on the edge, the positive one.
    signs = np.sign(side)
    alone = np.argmax(signs * np.sign(signs.sum(axis=1, keepdims=True)) < 0.0, axis=1)
    on_edge = (signs == 0.0).any(axis=1)
    alone = np.where(on_edge, np.argmax(signs > 0.0, axis=1), alone)
    order = (alone[:, None] + np.arange(3)) % 3
    tri = np.take_along_axis(tri, order[:, :, None], axis=1)
    side = np.take_along_axis(side, order, axis=1)
    a, b, c = tri[:, 0], tri[:, 1], tri[:, 2]
    ab, ac = _crossing(a, b, side[:, 0], side[:, 1]), _crossing(a, c, side[:, 0], side[:, 2])
    pieces = np.concatenate(
        [np.stack(corners, axis=1) for corners in ((a, ab, ac), (ab, b, c), (ab, c, ac))]
    )
    points = pieces[:, :, :3]
    areas = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    return np.concatenate((corners[~is_cut], pieces[(areas != 0.0).any(axis=1)]))


def _crossing(first: Floats, second: Floats, first_side: Floats, second_side: Floats) -> Floats:
    """Points (m, k) between two corners where the value is zero; an end without a sign change."""
    difference = first_side - second_side
    share = np.clip(first_side / np.where(difference == 0.0, 1.0, difference), 0.0, 1.0)[:, None]
    return first + share * (second - first)
