"""Reflection probes of a scene: viewpoints whose cube of light curved and rough surfaces reflect.

A surface has a probe if it reflects the scene and is not a planar mirror, or is thick glass, behind
which it shows the probe. The probe of a compact body is at its center, and does not show the body;
that of a sheet is in front of it; that of a hollow surface, such as a room, shows the surface
itself.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from omnisim.core.arrays import Floats
from omnisim.scene.parts import Material
from omnisim.scene.planar_mirrors import MirrorPlane, ShownSurface, is_surface_planar
from omnisim.scene.surface_kind import SurfaceKind, transmitted
from omnisim.scene.surface_reflectance import COAT_F0, dielectric_f0

# Mean cosine between outward directions and normals: 1 for a ball, −1 for a room.
_COMPACT, _HOLLOW = 0.25, -0.1
# Parts within a body share its probe up to this radius: a car, but not the shops of a mall.
_MAX_SHARED_RADIUS_M = 5.0
_SHEET_COSINE = 0.9  # length of the mean normal, from which a surface is a sheet
_SHEET_LIFT, _MAX_SHEET_LIFT_M = 0.25, 1.0  # height of its probe, as a share of its radius


@dataclass(frozen=True, eq=False)
class ProbePlace:
    """Reflection probe, in the world or in a dynamic object's frame."""

    object_index: int | None  # index of its dynamic object; None: static
    center_m: Floats  # (3,) viewpoint; of a deforming surface, at 0 s
    radius_m: float  # radius of the bounds of its largest surface
    area_m2: float  # area of that surface
    surfaces: frozenset[int]  # indices of the surfaces that reflect it
    left_out: frozenset[int]  # indices of the surfaces that it does not show
    # index of the deforming surface whose bounds it follows; None: rigid
    deforming: int | None = None


class _Box(NamedTuple):
    """Bounds (3,) of a surface in its object's frame."""

    low_m: Floats
    high_m: Floats

    @property
    def center_m(self) -> Floats:
        """Center (3,)."""
        return 0.5 * (self.low_m + self.high_m)

    @property
    def radius_m(self) -> float:
        """Radius of the sphere around it."""
        return float(0.5 * np.linalg.norm(self.high_m - self.low_m))


class _Boxes:
    """Bounds of all surfaces, by their index."""

    def __init__(self, surfaces: Mapping[int, ShownSurface]) -> None:
        self._boxes = {index: _box(one) for index, one in surfaces.items()}
        self._objects = {index: one.object_index for index, one in surfaces.items()}
        self._indices = np.array(list(surfaces), dtype=np.intp)
        self._centers_m = np.array([one.center_m for one in self._boxes.values()]).reshape(-1, 3)
        self._radii_m = np.array([one.radius_m for one in self._boxes.values()])

    def __getitem__(self, index: int) -> _Box:
        return self._boxes[index]

    def inside(self, index: int) -> frozenset[int]:
        """Surfaces of the same object, no larger than this one, whose center is in its box."""
        box, own = self._boxes[index], self._objects[index]
        is_inside = (box.low_m <= self._centers_m) & (self._centers_m <= box.high_m)
        held = self._indices[is_inside.all(axis=1) & (self._radii_m <= box.radius_m)]
        return frozenset(one for one in held.tolist() if self._objects[one] == own)


def find_probes(
    surfaces: Mapping[int, ShownSurface],
    planes: Sequence[MirrorPlane],
    possible: Collection[int] | None = None,
) -> tuple[ProbePlace, ...]:
    """Find the reflection probes of a scene, most prominent first; all of them, without a limit.

    Prominent are large, smooth surfaces of a high reflectance.

    Args:
        surfaces: surfaces of the scene and of its dynamic objects, by index.
        planes: planes of its mirrors and panes.
        possible: indices of the surfaces that may have a probe; None: all.
    """
    own = [
        index
        for index, one in surfaces.items()
        if (possible is None or index in possible)
        and one.kind & SurfaceKind.REFLECTING
        and len(one.mesh.triangles)
        and (one.kind & SurfaceKind.GLASS or not is_surface_planar(index, planes))
    ]
    if not own:
        return ()
    boxes = _Boxes(surfaces)
    places: list[ProbePlace] = []
    shared: list[tuple[int, frozenset[int]]] = []  # places, and the surfaces that may join them
    for index in sorted(own, key=lambda one: (-boxes[one].radius_m, one)):
        for number, inside in shared:
            if index in inside:
                place = places[number]
                places[number] = replace(
                    place, surfaces=place.surfaces | {index}, left_out=place.left_out | {index}
                )
                break
        else:
            place, is_shared = _place(index, surfaces[index], boxes[index])
            if is_shared:
                inside = boxes.inside(index)
                place = replace(place, left_out=place.left_out | inside)
                shared.append((len(places), inside))
            places.append(place)

    def prominence(place: ProbePlace) -> float:
        return place.area_m2 * max(_strength(surfaces[one].material) for one in place.surfaces)

    return tuple(sorted(places, key=lambda place: -prominence(place)))


def _strength(material: Material) -> float:
    """Reflectance at normal incidence of a material's strongest lobe, less for rough ones.

    Thick glass without a probe would be opaque: it counts as a mirror.
    """
    tinted = dielectric_f0(material.ior, material.specular, material.specular_color)
    metallic = material.metallic
    gloss = metallic * max(material.base_color[:3]) + (1.0 - metallic) * max(tinted)
    coat = COAT_F0 * material.clearcoat
    return max(
        transmitted(material, SurfaceKind.GLASS),
        gloss * (1.0 - material.roughness),
        coat * (1.0 - material.clearcoat_roughness),
    )


def _place(index: int, surface: ShownSurface, box: _Box) -> tuple[ProbePlace, bool]:
    """Probe of a surface, and whether parts within its bounds share it."""
    corners = _positions_m(surface)[surface.mesh.triangles]
    crosses = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    crosses *= np.sign(np.linalg.det(surface.object_from_mesh[:3, :3]))
    area_m2 = max(0.5 * float(np.linalg.norm(crosses, axis=1).sum()), 1e-30)
    place = ProbePlace(
        surface.object_index,
        box.center_m,
        box.radius_m,
        area_m2,
        frozenset((index,)),
        frozenset((index,)),
        None if surface.mesh.deformation is None else index,
    )
    if place.deforming is not None:
        return place, False
    normal = 0.5 * crosses.sum(axis=0) / area_m2
    if np.linalg.norm(normal) >= _SHEET_COSINE:
        lift_m = min(_SHEET_LIFT * box.radius_m, _MAX_SHEET_LIFT_M)
        return replace(place, center_m=box.center_m + lift_m * normal), False
    outward = corners.mean(axis=1) - box.center_m
    outward /= np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-30)
    cosine = 0.5 * float(np.einsum("nc,nc->", crosses, outward)) / area_m2
    is_small = box.radius_m <= _MAX_SHARED_RADIUS_M
    if cosine < (_HOLLOW if is_small else _COMPACT):
        return replace(place, left_out=frozenset()), False
    return place, is_small


def _positions_m(surface: ShownSurface) -> Floats:
    """Vertices (n, 3) in the object's frame."""
    matrix = surface.object_from_mesh
    return surface.mesh.positions.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]


def _box(surface: ShownSurface) -> _Box:
    if not len(surface.mesh.positions):
        return _Box(surface.object_from_mesh[:3, 3], surface.object_from_mesh[:3, 3])
    positions_m = _positions_m(surface)
    return _Box(positions_m.min(axis=0), positions_m.max(axis=0))
