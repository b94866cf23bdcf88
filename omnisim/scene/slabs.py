"""Slabs of glass: closed bodies between two parallel faces, which are panes of a thickness.

A mesh of clear, thick glass is recognized when a scene is built: each of its connected parts has
two parallel faces that look away from each other, and a rim that is small beside them. Back ends
and sensors ask its material, a `SlabMaterial`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from weakref import WeakKeyDictionary

import numpy as np

from omnisim.core.arrays import Floats, triangle_crosses
from omnisim.scene.parts import AlphaMode, Instance, Material, Mesh, SlabMaterial
from omnisim.scene.surface_kind import SurfaceKind, kind_of

_MAX_RIM_SHARE = 0.2  # of the area
_SAME_NORMAL = float(np.cos(np.radians(0.5)))
_SAME_HEIGHT = 0.01  # distance of the corners of a face from its plane, as a share of the thickness
_SAME_THICKNESS = 0.01  # relative difference of the slabs of one mesh

_Faces = tuple[Floats, float]
# faces of the parts of meshes; an edited scene shares its other meshes
_FACES: WeakKeyDictionary[Mesh, list[_Faces | None]] = WeakKeyDictionary()


def with_slabs(
    meshes: Sequence[Mesh], materials: Sequence[Material], instances: Sequence[Instance]
) -> tuple[tuple[Mesh, ...], tuple[Material, ...]]:
    """Meshes and materials of a scene, in which meshes that are slabs have a `SlabMaterial`."""
    places: dict[int, list[Floats]] = {}
    for instance in instances:
        material = materials[meshes[instance.mesh].material]
        is_opaque = material.alpha_mode is AlphaMode.OPAQUE and material.normal_map is None
        if is_opaque and material.thickness_m and kind_of(material) & SurfaceKind.GLASS:
            places.setdefault(instance.mesh, []).append(instance.world_from_mesh)
    found = {number: _thickness_m(meshes[number], own) for number, own in places.items()}
    slabs = {number: slab_m for number, slab_m in found.items() if slab_m is not None}
    meshes, materials = list(meshes), list(materials)
    taken = {mesh.material for number, mesh in enumerate(meshes) if number not in slabs}
    known: dict[tuple[int, str], int] = {}
    for number, slab_m in slabs.items():
        old, key = meshes[number].material, (meshes[number].material, f"{slab_m:.3g}")
        if key not in known:
            values = {field.name: getattr(materials[old], field.name) for field in fields(Material)}
            slab = SlabMaterial(**values | {"double_sided": False}, slab_m=slab_m)
            if old in taken:
                known[key] = len(materials)
                materials.append(slab)
            else:
                known[key], materials[old] = old, slab
                taken.add(old)
        meshes[number] = replace(meshes[number], material=known[key])
    return tuple(meshes), tuple(materials)


def _thickness_m(mesh: Mesh, places: Sequence[Floats]) -> float | None:
    """Thickness of a mesh's slabs in its places (4, 4) each; None: it is no slab."""
    if mesh.deformation is not None:
        return None
    thicknesses_m: list[float] = []
    for faces in _faces_of(mesh):
        if faces is None:
            return None
        normal, thickness = faces
        for place in places:
            if not np.linalg.det(place[:3, :3]):  # flattened to nothing
                return None
            across = np.linalg.solve(place[:3, :3].T, normal)
            thicknesses_m.append(thickness / float(np.linalg.norm(across)))
    least_m, most_m = min(thicknesses_m), max(thicknesses_m)
    return most_m if most_m - least_m <= _SAME_THICKNESS * most_m else None


def normal_of_slabs(mesh: Mesh) -> Floats:
    """Unit normal (3,) of the faces of a mesh of slabs; 0 if its slabs are not parallel."""
    normals = [np.zeros(3) if face is None else face[0] for face in _faces_of(mesh)]
    is_same = np.abs(normals @ normals[0]) >= _SAME_NORMAL
    return normals[0] if is_same.all() else np.zeros(3)


def _faces_of(mesh: Mesh) -> list[_Faces | None]:
    """Normal and distance of the faces of each part; None: it is no slab."""
    if mesh not in _FACES:
        _FACES[mesh] = [_faces(corners) for corners in _parts(mesh)]
    return _FACES[mesh]


def _parts(mesh: Mesh) -> list[Floats]:
    """Corners (n, 3, 3) of the triangles of each connected part; equal positions are connected."""
    import scipy  # few scenes have glass

    positions, vertex = np.unique(mesh.positions, axis=0, return_inverse=True)
    triangles, count = vertex.reshape(-1)[mesh.triangles], len(positions)
    first, second = np.concatenate((triangles[:, :2], triangles[:, 1:])).T
    graph = scipy.sparse.coo_array((np.ones(len(first)), (first, second)), (count, count))
    parts = scipy.sparse.csgraph.connected_components(graph, directed=False)[1][triangles[:, 0]]
    order = np.argsort(parts, kind="stable")
    starts = np.flatnonzero(np.diff(parts[order])) + 1
    return np.split(positions.astype(np.float64)[triangles[order]], starts)


def _faces(corners: Floats) -> _Faces | None:
    """Normal (3,) and distance of the two faces of a slab with triangles (n, 3, 3)."""
    crosses = 0.5 * triangle_crosses(corners)
    areas = np.linalg.norm(crosses, axis=1)
    if not areas.any():
        return None
    largest = int(np.argmax(areas))
    normal = crosses[largest] / areas[largest]
    heights = corners @ normal
    cosines = crosses @ normal / np.maximum(areas, 1e-30)
    low, high = heights.min(), heights.max()
    near = _SAME_HEIGHT * (high - low)
    front = (cosines >= _SAME_NORMAL) & (heights.min(axis=1) >= high - near)
    back = (cosines <= -_SAME_NORMAL) & (heights.max(axis=1) <= low + near)
    rim = areas.sum() - areas[front].sum() - areas[back].sum()
    is_slab = front.any() and back.any() and rim <= _MAX_RIM_SHARE * areas.sum()
    is_even = abs(areas[front].sum() - areas[back].sum()) <= _MAX_RIM_SHARE * areas.sum()
    return (normal, float(high - low)) if is_slab and is_even else None
