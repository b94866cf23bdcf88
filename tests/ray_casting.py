"""Reference ranges: rays cast by Embree.

The oracle is Embree's own casting; `omnisim.rendering.rays` feeds it, and tests/rendering/rays
holds that to every triangle tried in NumPy.
"""

import dataclasses

import numpy as np
import pytest

from omnisim.rendering.rays.caster import NO_TRIANGLE, WorldRays
from omnisim.rendering.rays.caster import RayCaster as Caster
from omnisim.scene.model import AlphaMode


def opaque_part(scene):
    """The scene without instances that a ray may go through."""
    kept = tuple(
        instance
        for instance in scene.instances
        if scene.materials[scene.meshes[instance.mesh].material].alpha_mode is AlphaMode.OPAQUE
    )
    return dataclasses.replace(scene, instances=kept)


def rays_from(origin, directions):
    """Rays from a point (3,) along unit directions (n, 3), world."""
    count = len(directions)
    origins = np.tile(np.asarray(origin, dtype=np.float64), (count, 1))
    return WorldRays(origins, directions, np.zeros(count), np.full(count, np.inf))


def embree_ranges(corners_m, origins_m, directions):
    """Ranges (n,) of rays (n, 3) to triangles (m, 3, 3), by embreex itself and then in float64.

    Embree, in float32, finds the triangle; +inf where it finds none.
    """
    pytest.importorskip("embreex", reason="embreex, the ray caster to compare with, is missing")
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    embree = EmbreeScene()
    mesh = TriangleMesh(embree, corners_m.astype(np.float32))  # keeps the vertices alive
    found = embree.run(origins_m.astype(np.float32), directions.astype(np.float32))
    del mesh
    hit = np.flatnonzero(found >= 0)
    a, b, c = np.moveaxis(corners_m[found[hit]], 1, 0)
    normals = np.cross(b - a, c - a)
    ranges_m = np.full(len(directions), np.inf)
    above = np.einsum("ij,ij->i", normals, a - origins_m[hit])
    ranges_m[hit] = above / np.einsum("ij,ij->i", normals, directions[hit])
    return ranges_m


class RayCaster:
    """Casts rays at all triangles of a scene, both sides; alpha counts for nothing."""

    def __init__(self, scene):
        pytest.importorskip("embreex", reason="embreex, the ray caster to compare with, is missing")
        self.caster = Caster(scene)

    def ranges(self, origin, directions):
        """Ranges (n,) along unit directions (n, 3), world; +inf where nothing is hit.

        Embree, in float32, says which triangle is hit; where, follows in float64.
        """
        return self.hits(origin, directions, both_sides=True)[1]

    def hits(self, origin, directions, both_sides=False):
        """Hits of those rays (m,) that hit, ranges (n,) of all, and the indices (m,)."""
        rays = rays_from(origin, directions)
        found = self.caster.cast(rays, both_sides=both_sides)
        hit = np.flatnonzero(found.triangles != NO_TRIANGLE)
        exact = self.caster.exact(rays.take(hit), found.take(hit))
        ranges_m = np.full(len(directions), np.inf)
        ranges_m[hit] = exact.ranges_m
        return exact, ranges_m, hit
