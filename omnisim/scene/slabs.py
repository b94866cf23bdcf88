"""Slabs of glass: closed bodies between two parallel faces, which are panes of a thickness.

A mesh of clear, thick glass is recognized when a scene is built: each of its connected parts has
two parallel faces that look away from each other, and a rim that is small beside them. Back ends
and sensors ask its material, a `SlabMaterial`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace

import numpy as np
import scipy  # loads its submodules on first use
from numpy.typing import NDArray

from omnisim.scene.parts import AlphaMode, Instance, Material, Mesh, SlabMaterial

_MAX_RIM_SHARE = 0.2  # of the area
_SAME_NORMAL = float(np.cos(np.radians(0.5)))
_SAME_HEIGHT = 0.01  # distance of the corners of a face from its plane, as a share of the thickness
_SAME_THICKNESS = 0.01  # relative difference of the slabs of one mesh


def with_slabs(
    meshes: Sequence[Mesh], materials: Sequence[Material], instances: Sequence[Instance]
) -> tuple[tuple[Mesh, ...], tuple[Material, ...]]:
    """Meshes and materials of a scene, in which meshes that are slabs have a `SlabMaterial`."""
    possible = {number for number, one in enumerate(materials) if _may_be_slab(one)}
    if not any(mesh.material in possible for mesh in meshes):
        return tuple(meshes), tuple(materials)
    meshes, all_materials = list(meshes), list(materials)
    for number, mesh in enumerate(meshes):
        places = [one.world_from_mesh for one in instances if one.mesh == number]
        if mesh.material not in possible or mesh.deformation is not None or not places:
            continue
        slab_m = _thickness_m(mesh, places)
        if slab_m is None:
            continue
        material = materials[mesh.material]
        own = {one.name: getattr(material, one.name) for one in fields(Material)}
        own["double_sided"] = False
        slab = SlabMaterial(**own, slab_m=slab_m)
        is_shared = any(
            one.material == mesh.material for other, one in enumerate(meshes) if other != number
        )
        if is_shared:
            meshes[number] = replace(mesh, material=len(all_materials))
            all_materials.append(slab)
        else:
            all_materials[mesh.material] = slab
    return tuple(meshes), tuple(all_materials)


def _may_be_slab(material: Material) -> bool:
    """True for clear, thick glass without normal maps that is no slab yet."""
    is_opaque = material.alpha_mode is AlphaMode.OPAQUE and material.normal_map is None
    return is_opaque and material.glass_transmission > 0.0


def _thickness_m(mesh: Mesh, places: Sequence[NDArray[np.float64]]) -> float | None:
    """Thickness of a mesh's slabs in its places (4, 4) each; None: it is no slab."""
    thicknesses_m: list[float] = []
    for corners in _parts(mesh):
        faces = _faces(corners)
        if faces is None:
            return None
        normal, thickness = faces
        for place in places:
            across = np.linalg.solve(place[:3, :3].T, normal)
            thicknesses_m.append(thickness / float(np.linalg.norm(across)))
    least_m, most_m = min(thicknesses_m), max(thicknesses_m)
    return most_m if most_m - least_m <= _SAME_THICKNESS * most_m else None


def _parts(mesh: Mesh) -> list[NDArray[np.float64]]:
    """Corners (n, 3, 3) of the triangles of each connected part; equal positions are connected."""
    positions, vertex = np.unique(mesh.positions, axis=0, return_inverse=True)
    triangles, count = vertex.reshape(-1)[mesh.triangles], len(positions)
    edges = triangles[:, [0, 1]], triangles[:, [1, 2]]
    first, second = np.concatenate(edges).T
    graph = scipy.sparse.coo_array((np.ones(len(first)), (first, second)), (count, count))
    parts = scipy.sparse.csgraph.connected_components(graph, directed=False)[1][triangles[:, 0]]
    order = np.argsort(parts, kind="stable")
    starts = np.flatnonzero(np.diff(parts[order])) + 1
    corners = positions.astype(np.float64)[triangles[order]]
    return [one for one in np.split(corners, starts) if len(one)]


def _faces(corners: NDArray[np.float64]) -> tuple[NDArray[np.float64], float] | None:
    """Normal (3,) and distance of the two faces of a slab with triangles (n, 3, 3)."""
    crosses = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(crosses, axis=1)
    largest = int(np.argmax(areas))
    if areas[largest] == 0.0:
        return None
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
