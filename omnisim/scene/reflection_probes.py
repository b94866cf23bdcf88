"""Reflection probes of a scene: viewpoints whose cube of light curved and rough surfaces reflect.

A surface has a probe if it reflects the scene and is not a planar mirror, or is thick glass, behind
which it shows the probe. The probe of a compact body is at its center, and does not show the body;
that of a sheet is in front of it; that of a hollow surface, such as a room, shows the surface
itself. Static planar mirrors and panes have probes, too, for where no mirrored view shows them:
within reflections, and beyond the number of mirrored views.
"""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from omnisim.core.arrays import Floats, bounds_of, triangle_crosses
from omnisim.scene.parts import Material
from omnisim.scene.planar_mirrors import (
    MirrorPlane,
    SceneSurface,
    find_mirrors,
    is_surface_planar,
)
from omnisim.scene.space.start_pose import nearest_points
from omnisim.scene.surface_kind import SurfaceKind, transmitted
from omnisim.scene.surface_reflectance import COAT_F0, dielectric_f0

# Mean cosine between outward directions and normals: 1 for a ball, −1 for a room.
_COMPACT, _HOLLOW = 0.25, -0.1
# Parts within a body share its probe up to this radius: a car, but not the shops of a mall.
_MAX_SHARED_RADIUS_M = 5.0
_SHEET_COSINE = 0.9  # length of the mean normal, from which a surface is a sheet
_SHEET_LIFT, _MAX_SHEET_LIFT_M = 0.25, 1.0  # height of its probe, as a share of its radius
# Coplanar surfaces share a probe up to this distance: tiles, but not the floors of two rooms.
_TILES_M = 2.0


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
    is_planar: bool = False  # of static planar mirrors or panes; it shows what is static


class Reflectors(NamedTuple):
    """Planes of the planar mirrors and of the panes of a scene, and its reflection probes.

    `planar_places` are the probes of planar mirrors and panes, `places` all others; both have the
    most prominent first.
    """

    mirrors: tuple[MirrorPlane, ...]
    panes: tuple[MirrorPlane, ...]
    places: tuple[ProbePlace, ...]
    planar_places: tuple[ProbePlace, ...] = ()

    def drawn(self, mirrors: int, probes: int) -> tuple[ProbePlace, ...]:
        """Probes that are drawn for a number of mirrored views, and of probes of each sort."""
        is_beyond = max(len(self.mirrors), len(self.panes)) > mirrors
        is_needed = is_beyond or self.repeats(mirrors, probes)
        return self.places[:probes] + (self.planar_places[:probes] if is_needed else ())

    def probed(self, probes: int) -> set[int]:
        """Indices of the surfaces that reflect the first probes, but for planar ones."""
        return {index for place in self.places[:probes] for index in place.surfaces}

    def repeats(self, mirrors: int, probes: int) -> bool:
        """True if two reflectors, other than panes, are of different surfaces."""
        panes = {number for plane in self.panes for number in plane.parts}
        reflectors = [set(plane.parts) for plane in self.mirrors if mirrors]
        reflectors += [set(place.surfaces) - panes for place in self.places[:probes]]
        pairs = itertools.combinations(filter(None, reflectors), 2)
        return any(one.isdisjoint(other) for one, other in pairs)


def find_reflectors(
    surfaces: Mapping[int, SceneSurface], possible: Iterable[int] | None = None
) -> Reflectors:
    """Find the mirrors, panes and probes of a scene; arguments as of `find_probes`."""
    some = surfaces if possible is None else {index: surfaces[index] for index in possible}
    mirrors = find_mirrors(some, SurfaceKind.PLANAR_MIRROR)
    panes = find_mirrors(some, SurfaceKind.PLANAR_PANE)
    planes = (*mirrors, *panes)
    places = find_probes(surfaces, planes, some.keys())
    return Reflectors(mirrors, panes, places, _planar_places(surfaces, planes, places))


def find_probes(
    surfaces: Mapping[int, SceneSurface],
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
        for index, surface in surfaces.items()
        if (possible is None or index in possible)
        and surface.kind & SurfaceKind.REFLECTING
        and len(surface.mesh.triangles)
        and (surface.kind & SurfaceKind.GLASS or not is_surface_planar(index, planes))
    ]
    if not own:
        return ()
    indices = np.array(list(surfaces), dtype=np.intp)
    boxes_m = np.array([_bounds_m(surface) for surface in surfaces.values()])  # (surfaces, 2, 3)
    centers_m = 0.5 * boxes_m.sum(axis=1)
    radii_m = np.array([0.5 * np.linalg.norm(high - low) for low, high in boxes_m])
    row_of = {index: row for row, index in enumerate(surfaces)}

    def inside(index: int) -> frozenset[int]:
        """Surfaces of the same object, no larger than this one, whose center is in its box."""
        row = row_of[index]
        low_m, high_m = boxes_m[row]
        is_inside = ((low_m <= centers_m) & (centers_m <= high_m)).all(axis=1)
        held = indices[is_inside & (radii_m <= radii_m[row])].tolist()
        own_object = surfaces[index].object_index
        return frozenset(
            surface for surface in held if surfaces[surface].object_index == own_object
        )

    places: list[ProbePlace] = []
    shared: list[tuple[int, frozenset[int]]] = []  # places, and the surfaces that may join them
    for index in sorted(own, key=lambda surface: (-radii_m[row_of[surface]], surface)):
        for number, within in shared:
            if index in within:
                place = places[number]
                places[number] = replace(
                    place, surfaces=place.surfaces | {index}, left_out=place.left_out | {index}
                )
                break
        else:
            row = row_of[index]
            place, is_shared = _place(index, surfaces[index], centers_m[row], float(radii_m[row]))
            if is_shared:
                place = replace(place, left_out=place.left_out | inside(index))
                shared.append((len(places), inside(index)))
            places.append(place)

    def prominence(place: ProbePlace) -> float:
        return place.area_m2 * max(
            _strength(surfaces[surface].material) for surface in place.surfaces
        )

    return tuple(sorted(places, key=lambda place: -prominence(place)))


def _planar_places(
    surfaces: Mapping[int, SceneSurface],
    planes: Sequence[MirrorPlane],
    others: Sequence[ProbePlace],
) -> tuple[ProbePlace, ...]:
    """Probes of static planar mirrors and panes without one among `others`, as `find_probes`.

    That of a flat surface is on it, as near to its center as its outline allows; that of a block is
    at its center.
    """
    placed = {index for place in others for index in place.surfaces}
    found: list[tuple[float, MirrorPlane, ProbePlace]] = []
    for plane in (mirror for mirror in planes if mirror.object_index is None):
        for index in sorted(set(plane.parts) - placed):
            placed.add(index)
            surface, own = surfaces[index], plane.parts[index]
            corners_m = surface.positions_m[surface.mesh.triangles]
            areas_m2 = 0.5 * np.linalg.norm(triangle_crosses(corners_m), axis=1)
            low_m, high_m = _bounds_m(surface)
            radius_m, center_m = 0.5 * float(np.linalg.norm(high_m - low_m)), 0.5 * (low_m + high_m)
            if own.all():
                middle_m = np.average(corners_m.mean(axis=1), axis=0, weights=areas_m2)
                nearest, gaps_m = nearest_points(corners_m - middle_m)
                center_m = middle_m + nearest[np.argmin(gaps_m)]
            alone, area_m2 = frozenset((index,)), float(areas_m2[own].sum())
            place = ProbePlace(None, center_m, radius_m, area_m2, alone, alone, is_planar=True)
            found.append((-area_m2 * _strength(surface.material), plane, place))
    places: list[tuple[MirrorPlane, ProbePlace]] = []
    for _, plane, place in sorted(found, key=lambda entry: entry[0]):
        for number, (other, larger) in enumerate(places):
            apart_m = float(np.linalg.norm(place.center_m - larger.center_m))
            if other is plane and apart_m <= _TILES_M:
                both = larger.surfaces | place.surfaces
                places[number] = other, replace(larger, surfaces=both, left_out=both)
                break
        else:
            places.append((plane, place))
    return tuple(place for _, place in places)


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


def _place(
    index: int, surface: SceneSurface, center_m: Floats, radius_m: float
) -> tuple[ProbePlace, bool]:
    """Probe of a surface with given bounds, and whether parts within them share it."""
    corners = surface.positions_m[surface.mesh.triangles]
    crosses = triangle_crosses(corners) * np.sign(np.linalg.det(surface.object_from_mesh[:3, :3]))
    area_m2 = max(0.5 * float(np.linalg.norm(crosses, axis=1).sum()), 1e-30)
    alone = frozenset((index,))
    place = ProbePlace(surface.object_index, center_m, radius_m, area_m2, alone, alone)
    if surface.mesh.deformation is not None:
        return replace(place, deforming=index), False
    normal = 0.5 * crosses.sum(axis=0) / area_m2
    if np.linalg.norm(normal) >= _SHEET_COSINE:
        lift_m = min(_SHEET_LIFT * radius_m, _MAX_SHEET_LIFT_M)
        return replace(place, center_m=center_m + lift_m * normal), False
    outward = corners.mean(axis=1) - center_m
    outward /= np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-30)
    cosine = 0.5 * float(np.einsum("nc,nc->", crosses, outward)) / area_m2
    is_small = radius_m <= _MAX_SHARED_RADIUS_M
    if cosine < (_HOLLOW if is_small else _COMPACT):
        return replace(place, left_out=frozenset()), False
    return place, is_small


def _bounds_m(surface: SceneSurface) -> Floats:
    """Smallest and largest corner (2, 3) in the object's frame; its origin without vertices."""
    if not len(surface.mesh.positions):
        return np.tile(surface.object_from_mesh[:3, 3], (2, 1))
    return bounds_of(surface.positions_m)
