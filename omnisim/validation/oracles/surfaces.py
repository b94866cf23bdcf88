"""Surfaces of a scene for other renderers: triangles and colors without instances."""

from __future__ import annotations

import dataclasses
from collections import defaultdict
from collections.abc import Iterable

import numpy as np

from omnisim.core.arrays import Floats, Floats32
from omnisim.core.errors import SceneError
from omnisim.scene import Scene
from omnisim.scene.model import AlphaMode, Instance, Material


@dataclasses.dataclass(frozen=True, eq=False)
class OracleSurface:
    """All triangles of one material."""

    material: Material  # material of all triangles
    # (n, 3, 3) float64 corners, meters from the effective viewpoint along the world's axes,
    # counter-clockwise seen from the front
    triangles_m: Floats
    # (n, 3, 2) float32, (0, 0) at the texture's top left; None: no texture, or no coordinates in
    # the mesh
    texture_coordinates: Floats32 | None
    # (n, 3, 3) float32 linear RGB of the corners, without the material's color; None: no vertex
    # colors
    colors: Floats32 | None


def opaque_only(scene: Scene) -> Scene:
    """The scene without masked and blended surfaces, which renderers draw differently.

    Raises:
        SceneError: no surface is left.
    """
    kept = [
        instance
        for instance in scene.instances
        if scene.materials[scene.meshes[instance.mesh].material].alpha_mode is AlphaMode.OPAQUE
    ]
    if not kept:
        raise SceneError(f"{scene.name}: no opaque surface")
    used = sorted({instance.mesh for instance in kept})
    return dataclasses.replace(
        scene,
        meshes=tuple(scene.meshes[index] for index in used),
        instances=tuple(
            dataclasses.replace(instance, mesh=used.index(instance.mesh)) for instance in kept
        ),
    )


def visible_surfaces(scene: Scene, viewpoint_m: Floats, reach_m: float) -> list[OracleSurface]:
    """Surfaces with their front toward a point within `reach_m` of the viewpoint (3,), world.

    Other single-sided triangles are left out: they are invisible from behind, while other renderers
    draw them black. Double-sided ones are turned to face the viewpoint.

    Raises:
        SceneError: a surface is not opaque.
    """
    batches: dict[tuple[int, bool, bool], list[OracleSurface]] = defaultdict(list)
    for instance in scene.instances:
        surface = _surface(scene, instance, viewpoint_m, reach_m)
        if len(surface.triangles_m):
            index = scene.meshes[instance.mesh].material
            key = (index, surface.texture_coordinates is None, surface.colors is None)
            batches[key].append(surface)

    def join(arrays: Iterable[Floats32 | None]) -> Floats32 | None:
        present = [array for array in arrays if array is not None]
        return np.concatenate(present) if present else None

    return [
        OracleSurface(
            parts[0].material,
            np.concatenate([part.triangles_m for part in parts]),
            join(part.texture_coordinates for part in parts),
            join(part.colors for part in parts),
        )
        for parts in batches.values()
    ]


def _surface(
    scene: Scene, instance: Instance, viewpoint_m: Floats, reach_m: float
) -> OracleSurface:
    mesh = scene.meshes[instance.mesh]
    material = scene.materials[mesh.material]
    if material.alpha_mode is not AlphaMode.OPAQUE:
        raise SceneError(f"material {material.name!r} is not opaque: `opaque_only` leaves it out")
    linear = instance.world_from_mesh[:3, :3]
    offset_m = instance.world_from_mesh[:3, 3] - viewpoint_m
    positions_m = mesh.positions.astype(np.float64) @ linear.T + offset_m
    triangles = mesh.triangles
    if np.linalg.det(linear) < 0.0:  # mirrored: the winding is reversed in the world
        triangles = triangles[:, ::-1]
    first, second, third = (positions_m[triangles[:, corner]] for corner in range(3))
    normals = np.cross(second - first, third - first)
    lengths = np.linalg.norm(normals, axis=1)
    heights = -np.sum(normals * first, axis=1)  # of the viewpoint above the plane, times lengths
    kept = lengths > 0.0
    if material.double_sided:
        triangles = np.where(heights[:, None] < 0.0, triangles[:, ::-1], triangles)
    else:
        kept &= heights > -reach_m * lengths
    triangles = triangles[kept]
    coordinates = None if material.texture is None else mesh.texture_coordinates
    return OracleSurface(
        material,
        positions_m[triangles],
        None if coordinates is None else coordinates[triangles],
        None if mesh.colors is None else mesh.colors[triangles][..., :3],
    )
