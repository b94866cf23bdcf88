"""Static batching: one mesh per material, in world coordinates."""

from __future__ import annotations

import dataclasses
from collections import defaultdict
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from omnisim.scene.model import AlphaMode, Instance, Mesh, Scene


def batched(scene: Scene) -> Scene:
    """Scene with one mesh per material, in the order of the instances, except for blended ones."""
    parts: dict[tuple[int, bool, bool, bool], list[Mesh]] = defaultdict(list)
    meshes: list[Mesh] = []
    instances: list[Instance] = []
    for instance in scene.instances:
        mesh = scene.meshes[instance.mesh]
        if scene.materials[mesh.material].alpha_mode is AlphaMode.BLEND:
            instances.append(dataclasses.replace(instance, mesh=len(meshes)))
            meshes.append(mesh)
            continue
        key = (
            mesh.material,
            mesh.normals is None,
            mesh.texture_coordinates is None,
            mesh.colors is None,
        )
        parts[key].append(in_world(mesh, instance))
    for same in parts.values():
        instances.append(Instance(same[0].name, len(meshes), np.eye(4)))
        meshes.append(_joined(same))
    return dataclasses.replace(scene, meshes=tuple(meshes), instances=tuple(instances))


def in_world(mesh: Mesh, instance: Instance) -> Mesh:
    """Mesh of an instance in world coordinates: positions, normals and winding."""
    matrix = instance.world_from_mesh
    linear = matrix[:3, :3]
    triangles, normals = mesh.triangles, mesh.normals
    determinant = float(np.linalg.det(linear))
    if determinant < 0.0:
        triangles = triangles[:, ::-1]
    if normals is not None:
        # cofactors transform normals under any scale, and keep them outward
        cofactors = np.array([np.cross(linear[i - 2], linear[i - 1]) for i in range(3)])
        normals = (normals @ (np.sign(determinant) * cofactors).T).astype(np.float32)
    positions = mesh.positions.astype(np.float64) @ linear.T + matrix[:3, 3]
    return dataclasses.replace(
        mesh,
        positions=positions.astype(np.float32),
        triangles=np.ascontiguousarray(triangles),
        normals=normals,
    )


def _joined(meshes: list[Mesh]) -> Mesh:
    firsts = np.cumsum([0, *(len(mesh.positions) for mesh in meshes[:-1])])
    triangles = [
        mesh.triangles + np.uint32(first) for mesh, first in zip(meshes, firsts, strict=True)
    ]

    def join(arrays: Iterable[NDArray[np.float32] | None]) -> NDArray[np.float32] | None:
        found = [array for array in arrays if array is not None]
        return np.concatenate(found) if found else None

    return dataclasses.replace(
        meshes[0],
        positions=np.concatenate([mesh.positions for mesh in meshes]),
        triangles=np.concatenate(triangles),
        normals=join(mesh.normals for mesh in meshes),
        texture_coordinates=join(mesh.texture_coordinates for mesh in meshes),
        colors=join(mesh.colors for mesh in meshes),
    )
