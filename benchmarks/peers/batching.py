"""One mesh a material, in the axes of the world: what engines make of geometry that never moves."""

from __future__ import annotations

import dataclasses
from collections import defaultdict

import numpy as np

from omnisim.scene.model import AlphaMode, Instance, Mesh, Scene


def batched(scene: Scene) -> Scene:
    """The scene with the instances of each material in one mesh; blended ones stay as they are.

    Within a material the instances keep their order.
    """
    parts: dict[tuple[int, bool, bool, bool], list[Mesh]] = defaultdict(list)
    meshes: list[Mesh] = []
    instances: list[Instance] = []
    for instance in scene.instances:
        mesh = scene.meshes[instance.mesh]
        if scene.materials[mesh.material].alpha_mode is AlphaMode.BLEND:
            instances.append(dataclasses.replace(instance, mesh=len(meshes)))
            meshes.append(mesh)
            continue
        look = (
            mesh.material,
            mesh.normals is None,
            mesh.texture_coordinates is None,
            mesh.colors is None,
        )
        parts[look].append(in_world(mesh, instance))
    for same in parts.values():
        instances.append(Instance(same[0].name, len(meshes), np.eye(4)))
        meshes.append(_joined(same))
    return dataclasses.replace(scene, meshes=tuple(meshes), instances=tuple(instances))


def in_world(mesh: Mesh, instance: Instance) -> Mesh:
    """An instance's mesh with its positions, normals and winding as they are in the world."""
    matrix = instance.world_from_mesh
    linear = matrix[:3, :3]
    triangles, normals = mesh.triangles, mesh.normals
    determinant = float(np.linalg.det(linear))
    if determinant < 0.0:
        triangles = triangles[:, ::-1]
    if normals is not None:
        # cofactors turn normals under any scale, and keep them outside
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
    joined = {
        name: np.concatenate([getattr(mesh, name) for mesh in meshes])
        for name in ("positions", "normals", "texture_coordinates", "colors")
        if getattr(meshes[0], name) is not None
    }
    return dataclasses.replace(meshes[0], triangles=np.concatenate(triangles), **joined)
