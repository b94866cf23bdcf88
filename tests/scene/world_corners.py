"""Triangles of scenes in the world."""

import numpy as np
import trimesh


def corners_of(scene, name=None):
    """Corners (n, 3, 3) of the triangles of all instances, or of those of a name."""
    parts = []
    for instance in scene.instances:
        if name in (None, instance.name):
            mesh, matrix = scene.meshes[instance.mesh], instance.world_from_mesh
            world = mesh.positions.astype(float) @ matrix[:3, :3].T + matrix[:3, 3]
            parts.append(world[mesh.triangles])
    return np.concatenate(parts)


def points_of(scene, instance=0):
    """Vertices (n, 3) of an instance by its number."""
    placed = scene.instances[instance]
    positions = scene.meshes[placed.mesh].positions
    return positions @ placed.world_from_mesh[:3, :3].T + placed.world_from_mesh[:3, 3]


def solid_of(scene, name=None):
    """Triangles of all instances, or of those of a name, as trimesh's; equal corners are one."""
    corners = corners_of(scene, name)
    solid = trimesh.Trimesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
    solid.merge_vertices(digits_vertex=6)
    return solid


def material_of(scene, name):
    """Material of the first instance of a name."""
    mesh = next(instance.mesh for instance in scene.instances if instance.name == name)
    return scene.materials[scene.meshes[mesh].material]
