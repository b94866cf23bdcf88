"""Planar mirrors of a scene: planes in which smooth materials reflect exactly one mirrored view.

A plane counts if it holds at least `MIN_PLANE_SHARE` of its mesh's area, and is among the
`MAX_PLANES` largest of the scene. Coplanar surfaces share one.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from omnisim.core.arrays import Bools, Floats, triangle_crosses
from omnisim.scene.model import Scene
from omnisim.scene.parts import Material, Mesh
from omnisim.scene.surface_kind import SurfaceKind, kind_of

MIN_PLANE_SHARE, MAX_PLANES = 0.05, 64
# Differences within one plane: of unit normals, of heights as a share of the mesh's size, and of
# offsets. They shift a reflection by up to 0.1 px at 40 px per degree.
_SAME_NORMAL, _SAME_HEIGHT, _SAME_OFFSET_M = 2e-5, 2e-5, 1e-4
# Interpolated normals within 0.1° of the plane's are those of a plane.
_MIN_NORMAL_COSINE = float(np.cos(np.radians(0.1)))


class SceneSurface(NamedTuple):
    """Instance of a mesh, as a scene shows it."""

    mesh: Mesh
    material: Material
    kind: SurfaceKind
    object_from_mesh: Floats  # (4, 4), to the world or the dynamic object's frame
    object_index: int | None  # index of its dynamic object; None: static

    @property
    def positions_m(self) -> Floats:
        """Vertices (n, 3) in the world or the dynamic object's frame."""
        matrix = self.object_from_mesh
        return self.mesh.positions.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]


def scene_surfaces(scene: Scene, objects: Iterable[Scene]) -> dict[int, SceneSurface]:
    """Surfaces of a scene, then those of dynamic objects, by their number.

    Args:
        scene: static scene.
        objects: shapes of the dynamic objects.
    """
    surfaces: list[SceneSurface] = []
    for index, shape in [(None, scene), *enumerate(objects)]:
        for instance in shape.instances:
            mesh = shape.meshes[instance.mesh]
            material = shape.materials[mesh.material]
            kind = kind_of(material, scene.lighting.is_matte)
            surfaces.append(SceneSurface(mesh, material, kind, instance.world_from_mesh, index))
    return dict(enumerate(surfaces))


def has_specular(scene: Scene, objects: Iterable[Scene]) -> bool:
    """True if a scene, or one of its dynamic objects, has visible glass or mirrors."""
    surfaces = scene_surfaces(scene, objects)
    return any(surface.kind & SurfaceKind.SPECULAR for surface in surfaces.values())


@dataclass(frozen=True, eq=False)
class MirrorPlane:
    """Plane of one or more mirrors, in the world or in a dynamic object's frame."""

    object_index: int | None  # index of its dynamic object; None: static
    normal: Floats  # (3,) unit normal
    offset_m: float  # distance of the plane from the origin, along the normal
    area_m2: float  # area of its triangles
    # signs of the sides from which it is visible: 1 for that of the normal, −1
    sides: frozenset[int]
    # indices of the surfaces on it, each with the mask (triangles,) of its triangles
    parts: dict[int, Bools]


class FlatPart(NamedTuple):
    """Coplanar triangles of a mesh, in its frame."""

    # normal, point: (3,) unit normal and a point of the plane
    normal: Floats
    point: Floats
    area: float  # area of the triangles
    sides: frozenset[int]  # see `MirrorPlane`
    triangles: Bools  # mask (triangles,) of the triangles


def find_mirrors(
    surfaces: Mapping[int, SceneSurface], asked: SurfaceKind
) -> tuple[MirrorPlane, ...]:
    """Find the planes of planar mirrors or panes, largest first.

    Args:
        surfaces: surfaces of the scene and of its dynamic objects, by index.
        asked: kinds of the surfaces whose planes to find.
    """
    of_mesh: dict[int, list[FlatPart]] = {}
    parts: list[MirrorPlane] = []
    for index, surface in surfaces.items():
        mesh = surface.mesh
        if mesh.deformation is None and surface.kind & asked:
            if id(mesh) not in of_mesh:
                of_mesh[id(mesh)] = flat_parts(mesh)
            parts += [_placed(index, surface, part) for part in of_mesh[id(mesh)]]
    return _joined(sorted(parts, key=lambda part: -part.area_m2))


def _placed(index: int, surface: SceneSurface, part: FlatPart) -> MirrorPlane:
    transform = surface.object_from_mesh
    linear = transform[:3, :3]
    cofactors = np.cross(linear[[1, 2, 0]], linear[[2, 0, 1]])
    normal = cofactors @ part.normal
    scale = max(float(np.linalg.norm(normal)), 1e-30)
    normal *= np.sign(np.linalg.det(linear)) / scale
    offset_m = float((linear @ part.point + transform[:3, 3]) @ normal)
    sides = frozenset((1, -1)) if surface.material.double_sided else part.sides
    area_m2, parts = scale * part.area, {index: part.triangles}
    return MirrorPlane(surface.object_index, normal, offset_m, area_m2, sides, parts)


def _joined(parts: Sequence[MirrorPlane]) -> tuple[MirrorPlane, ...]:
    """Join coplanar parts, given the largest first; the smallest may be omitted."""
    normals = np.array([part.normal for part in parts]).reshape(-1, 3)
    offsets_m = np.array([part.offset_m for part in parts])
    objects = np.array([-1 if part.object_index is None else part.object_index for part in parts])
    left = np.ones(len(parts), dtype=np.bool_)
    planes: list[MirrorPlane] = []
    while left.any() and len(planes) < 4 * MAX_PLANES:
        number = int(np.argmax(left))
        first = parts[number]
        signs = np.where(normals @ first.normal < 0.0, -1, 1)
        turned = np.linalg.norm(signs[:, None] * normals - first.normal, axis=1)
        beside_m = np.abs(signs * offsets_m - first.offset_m)
        is_own = left & (objects == objects[number])
        is_own &= (turned <= _SAME_NORMAL) & (beside_m <= _SAME_OFFSET_M)
        is_own[number] = True
        left &= ~is_own
        area_m2, sides, masks = 0.0, frozenset[int](), dict[int, Bools]()
        for own in np.flatnonzero(is_own).tolist():
            area_m2 += parts[own].area_m2
            sides |= {int(signs[own]) * side for side in parts[own].sides}
            for surface, triangles in parts[own].parts.items():
                masks[surface] = masks.get(surface, np.False_) | triangles
        planes.append(replace(first, area_m2=area_m2, sides=sides, parts=masks))
    return tuple(sorted(planes, key=lambda plane: -plane.area_m2)[:MAX_PLANES])


def is_surface_planar(number: int, planes: Sequence[MirrorPlane]) -> bool:
    """True if planar mirrors hold all triangles of a surface."""
    masks = [plane.parts[number] for plane in planes if number in plane.parts]
    return bool(masks) and bool(np.any(masks, axis=0).all())


def flat_parts(mesh: Mesh) -> list[FlatPart]:
    """Coplanar parts of a mesh; triangles with curved normals are in none."""
    if len(mesh.triangles) == 0:
        return []
    positions = mesh.positions.astype(np.float64)
    corners, middle = positions[mesh.triangles], positions.mean(axis=0)
    crosses = 0.5 * triangle_crosses(corners)
    areas = np.linalg.norm(crosses, axis=1)
    normals = crosses / np.maximum(areas, 1e-30)[:, None]
    size = max(float(np.ptp(positions, axis=0).max()), 1e-30)
    min_area = MIN_PLANE_SHARE * float(areas.sum())
    left = (areas > 0.0) & _has_flat_normals(mesh, normals)
    parts = []
    left_areas = np.where(left, areas, 0.0)
    # rounding may split a plane into several classes
    for first in _candidates(normals, corners - middle, size, left_areas, 0.25 * min_area):
        heights = (corners - corners[first, 0]) @ normals[first]
        triangles = left & (np.abs(heights).max(axis=1) <= _SAME_HEIGHT * size)
        area = float(areas[triangles].sum())
        if not left[first] or area < min_area:
            continue
        left &= ~triangles
        # both sides of a sheet are one plane
        signs = np.sign(normals[triangles] @ normals[first])
        normal = signs @ crosses[triangles]
        normal /= np.linalg.norm(normal)
        point = corners[triangles].mean(axis=(0, 1))
        sides = frozenset(signs.astype(int).tolist())
        parts.append(FlatPart(normal, point, area, sides, triangles))
    return parts


def _has_flat_normals(mesh: Mesh, normals: Floats) -> Bools:
    """Mask of the triangles (n,) whose vertex normals are, up to sign, their own (n, 3)."""
    if mesh.normals is None:
        return np.ones(len(normals), dtype=np.bool_)
    of_vertices = mesh.normals.astype(np.float64)
    lengths = np.linalg.norm(of_vertices, axis=1, keepdims=True)
    of_vertices /= np.maximum(lengths, 1e-30)
    cosines = np.abs(np.einsum("nkc,nc->nk", of_vertices[mesh.triangles], normals))
    is_missing = lengths[mesh.triangles, 0] < 1e-20  # the triangle's normal is used
    return np.all(is_missing | (cosines >= _MIN_NORMAL_COSINE), axis=1)


def _candidates(
    normals: Floats, corners: Floats, size: float, areas: Floats, min_area: float
) -> list[int]:
    """Largest triangle of each coarse class of planes that holds at least an area, and some."""
    offsets = np.einsum("nc,nc->n", normals, corners[:, 0]) / size
    classes = np.rint(np.column_stack((normals, offsets)) * 200.0).astype(np.int64)
    _, inverse = np.unique(classes, axis=0, return_inverse=True)
    inverse = inverse.reshape(-1)
    sums = np.bincount(inverse, weights=areas)
    kept = np.flatnonzero((sums > 0.0) & (sums >= min_area))
    largest = [int(np.argmax(np.where(inverse == plane, areas, 0.0))) for plane in kept.tolist()]
    return sorted(largest, key=lambda index: -areas[index])
