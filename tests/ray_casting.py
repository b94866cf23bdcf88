"""Reference ranges: rays cast by Embree."""

import numpy as np
import pytest

from benchmarks.embree_rays import EmbreeMesh
from omnisim.scene.model import AlphaMode, Scene


def opaque_part(scene):
    """The scene without instances that a ray may go through."""
    kept = tuple(
        instance
        for instance in scene.instances
        if scene.materials[scene.meshes[instance.mesh].material].alpha_mode is AlphaMode.OPAQUE
    )
    return Scene(
        scene.name, scene.meshes, scene.materials, kept, scene.lighting, scene.background,
        scene.start,
    )  # fmt: skip


def first_hits(mesh, origin, directions):
    """Indices of the triangles that rays (n, 3) from a point hit, and of these rays."""
    origins = np.broadcast_to(np.float32(origin), directions.shape).copy()
    found = mesh.triangles_hit(origins, directions.astype(np.float32))
    rays = np.flatnonzero(found >= 0)
    return found[rays], rays


class RayCaster:
    """Casts rays at all triangles of a scene; alpha counts for nothing."""

    def __init__(self, scene):
        pytest.importorskip("embreex", reason="embreex, the ray caster to compare with, is missing")
        triangles = []
        for instance in scene.instances:
            mesh, matrix = scene.meshes[instance.mesh], instance.world_from_mesh
            points = mesh.positions.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
            triangles.append(points[mesh.triangles])
        self._triangles = np.concatenate(triangles)
        self._mesh = EmbreeMesh.of_corners(self._triangles)

    def ranges(self, origin, directions):
        """Ranges (n,) along unit directions (n, 3), world; +inf where nothing is hit.

        Embree, in float32, says which triangle is hit; where, follows in float64.
        """
        triangles, rays = first_hits(self._mesh, origin, directions)
        corners = self._triangles[triangles]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        ranges = np.full(len(directions), np.inf)
        ranges[rays] = np.einsum("ij,ij->i", normals, corners[:, 0] - origin) / np.einsum(
            "ij,ij->i", normals, directions[rays]
        )
        return ranges
