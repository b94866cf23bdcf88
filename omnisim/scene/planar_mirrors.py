"""Planar mirrors of a scene: planes in which smooth materials reflect exactly one mirrored view.

A plane counts if it holds at least `MIN_PLANE_SHARE` of its mesh's area, and is among the
`MAX_PLANES` largest of the scene. Coplanar surfaces share one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from omnisim.scene.parts import AlphaMode, Material, Mesh
from omnisim.scene.surface_reflectance import MAX_MIRRORED_ROUGHNESS, MIN_ROUGHNESS

MIN_PLANE_SHARE, MAX_PLANES = 0.05, 64
# Differences within one plane: of unit normals, of heights as a share of the mesh's size, and of
# offsets. They shift a reflection by up to 0.1 px at 40 px per degree.
_SAME_NORMAL, _SAME_HEIGHT, _SAME_OFFSET_M = 2e-5, 2e-5, 1e-4
# Interpolated normals within 0.1° of the plane's are those of a plane.
_MIN_NORMAL_COSINE = float(np.cos(np.radians(0.1)))


class ShownSurface(Protocol):
    """Mesh in its place, such as a draw item."""

    @property
    def mesh(self) -> Mesh:
        """Mesh of the surface."""

    @property
    def material(self) -> Material:
        """Material of the mesh."""

    @property
    def object_index(self) -> int | None:
        """Index of its dynamic object; None: static."""

    @property
    def object_from_mesh(self) -> NDArray[np.float64]:
        """(4, 4) transform to the world or the dynamic object's frame."""


@dataclass(frozen=True, eq=False)
class MirrorPlane:
    """Plane of one or more mirrors, in the world or in a dynamic object's frame.

    Attributes:
        object_index: index of its dynamic object; None: static.
        normal: (3,) unit normal.
        offset_m: distance of the plane from the origin, along the normal.
        area_m2: area of its triangles.
        sides: signs of the sides from which it is visible: 1 for that of the normal, −1.
        parts: indices of the surfaces on it, each with the mask (triangles,) of its triangles.
    """

    object_index: int | None
    normal: NDArray[np.float64]
    offset_m: float
    area_m2: float
    sides: frozenset[int]
    parts: dict[int, NDArray[np.bool_]]


class FlatPart(NamedTuple):
    """Coplanar triangles of a mesh, after a transform; fields as in `MirrorPlane`."""

    normal: NDArray[np.float64]
    offset_m: float
    area_m2: float
    sides: frozenset[int]
    triangles: NDArray[np.bool_]


def is_smooth(material: Material, max_roughness: float) -> bool:
    """True for metal, gloss or clear coats that somewhere are at most this rough."""
    if material.is_matte:
        return False
    roughness = material.roughness
    if material.metallic_roughness_map is not None:
        roughness *= float(material.metallic_roughness_map.pixels[..., 1].min()) / 255.0
    is_glossy = bool(material.metallic or material.specular)
    is_coated = bool(material.clearcoat) and material.clearcoat_roughness <= max_roughness
    return is_coated or (is_glossy and roughness <= max_roughness)


def is_planar_mirror(material: Material) -> bool:
    """True for smooth, opaque materials without normal maps."""
    return (
        _is_flat(material)
        and not material.pane_transmission
        and is_smooth(material, MAX_MIRRORED_ROUGHNESS)
    )


def is_rough_mirror(material: Material) -> bool:
    """True for planar mirrors whose gloss or coat may be rougher than a perfect mirror."""
    is_rough = material.roughness > MIN_ROUGHNESS and bool(material.metallic or material.specular)
    is_coated = material.clearcoat > 0.0 and material.clearcoat_roughness > MIN_ROUGHNESS
    return not material.pane_transmission and (is_rough or is_coated)


def is_clear_pane(material: Material) -> bool:
    """True for panes without normal maps; they reflect like mirrors."""
    return _is_flat(material) and material.pane_transmission > 0.0


def _is_flat(material: Material) -> bool:
    """True without holes, blending and normal maps."""
    has_normal_map = material.normal_map or material.clearcoat_normal_map
    return material.alpha_mode is AlphaMode.OPAQUE and has_normal_map is None


def find_mirrors(
    surfaces: Mapping[int, ShownSurface], is_mirror: Callable[[Material], bool]
) -> tuple[MirrorPlane, ...]:
    """Find the planes of planar mirrors, largest first.

    Args:
        surfaces: surfaces of the scene and of its dynamic objects, by index.
        is_mirror: tells whether planes of a material are mirrors.
    """
    planes: list[MirrorPlane] = []
    for index, surface in surfaces.items():
        is_rigid = surface.mesh.deformation is None
        if is_rigid and is_mirror(surface.material):
            for part in flat_parts(surface.mesh, surface.object_from_mesh):
                if surface.material.double_sided:
                    part = part._replace(sides=frozenset((1, -1)))
                _add(planes, index, surface.object_index, part)
    return tuple(sorted(planes, key=lambda plane: -plane.area_m2)[:MAX_PLANES])


def _add(planes: list[MirrorPlane], surface: int, object_index: int | None, part: FlatPart) -> None:
    """Add a part to its plane, or to a new one."""
    for number, plane in enumerate(planes):
        sign = 1 if part.normal @ plane.normal > 0.0 else -1
        if (
            plane.object_index == object_index
            and np.linalg.norm(sign * part.normal - plane.normal) <= _SAME_NORMAL
            and abs(sign * part.offset_m - plane.offset_m) <= _SAME_OFFSET_M
        ):
            triangles = plane.parts.get(surface, np.zeros_like(part.triangles)) | part.triangles
            planes[number] = replace(
                plane,
                area_m2=plane.area_m2 + part.area_m2,
                sides=plane.sides | {sign * side for side in part.sides},
                parts={**plane.parts, surface: triangles},
            )
            return
    normal, offset_m, area_m2, sides, triangles = part
    parts = {surface: triangles}
    planes.append(MirrorPlane(object_index, normal, offset_m, area_m2, sides, parts))


def flat_parts(mesh: Mesh, transform: NDArray[np.float64]) -> list[FlatPart]:
    """Coplanar parts of a transformed mesh; triangles with curved normals are in none."""
    if len(mesh.triangles) == 0:
        return []
    positions = mesh.positions @ transform[:3, :3].T + transform[:3, 3]
    corners, middle = positions[mesh.triangles], positions.mean(axis=0)
    crosses = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas_m2 = np.linalg.norm(crosses, axis=1)
    normals = crosses / np.maximum(areas_m2, 1e-30)[:, None]
    size_m = max(float(np.ptp(positions, axis=0).max()), 1e-30)
    min_area_m2 = MIN_PLANE_SHARE * float(areas_m2.sum())
    left = (areas_m2 > 0.0) & _has_flat_normals(mesh, transform, normals)
    handedness = np.sign(np.linalg.det(transform[:3, :3]))
    parts = []
    for first in _candidates(normals, corners - middle, size_m, np.where(left, areas_m2, 0.0)):
        if not left[first]:
            continue
        heights_m = (corners - corners[first, 0]) @ normals[first]
        is_level = np.abs(heights_m).max(axis=1) <= _SAME_HEIGHT * size_m
        triangles = left & is_level
        area_m2 = float(areas_m2[triangles].sum())
        if area_m2 < min_area_m2:
            continue
        left &= ~triangles
        # both sides of a sheet are one plane
        signs = np.sign(normals[triangles] @ normals[first])
        normal = signs @ crosses[triangles]
        normal /= np.linalg.norm(normal)
        offset_m = float(corners[triangles].mean(axis=(0, 1)) @ normal)
        sides = frozenset((signs * handedness).astype(int).tolist())
        parts.append(FlatPart(normal, offset_m, area_m2, sides, triangles))
    return parts


def _has_flat_normals(
    mesh: Mesh, transform: NDArray[np.float64], normals: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Mask of the triangles (n,) whose vertex normals are, up to sign, their own (n, 3)."""
    if mesh.normals is None:
        return np.ones(len(normals), dtype=np.bool_)
    linear = transform[:3, :3]
    cofactors = np.cross(linear[[1, 2, 0]], linear[[2, 0, 1]])
    of_vertices = mesh.normals.astype(np.float64) @ cofactors.T
    lengths = np.linalg.norm(of_vertices, axis=1, keepdims=True)
    of_vertices /= np.maximum(lengths, 1e-30)
    cosines = np.abs(np.einsum("nkc,nc->nk", of_vertices[mesh.triangles], normals))
    is_missing = lengths[mesh.triangles, 0] < 1e-20  # the triangle's normal is used
    flat: NDArray[np.bool_] = np.all(is_missing | (cosines >= _MIN_NORMAL_COSINE), axis=1)
    return flat


def _candidates(
    normals: NDArray[np.float64],
    corners: NDArray[np.float64],
    size_m: float,
    areas_m2: NDArray[np.float64],
) -> list[int]:
    """Largest triangle of each coarse class of planes that may hold enough area."""
    offsets = np.einsum("nc,nc->n", normals, corners[:, 0]) / size_m
    classes = np.rint(np.column_stack((normals, offsets)) * 200.0).astype(np.int64)
    _, inverse = np.unique(classes, axis=0, return_inverse=True)
    inverse = inverse.reshape(-1)
    sums = np.bincount(inverse, weights=areas_m2)
    # rounding may split a plane
    kept = np.flatnonzero(sums >= 0.25 * MIN_PLANE_SHARE * areas_m2.sum())
    largest = [int(np.argmax(np.where(inverse == one, areas_m2, 0.0))) for one in kept.tolist()]
    return sorted(largest, key=lambda index: -areas_m2[index])
