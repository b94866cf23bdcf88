"""Two scenes of the same shapes, whatever the order of their vertices."""

import numpy as np
from scipy.spatial import cKDTree

# Stored in steps of 1e-5 m. Processors round sines differently in the last bit: where that leads to
# another step, a vertex is merged with its neighbor or not, and origins of meshes move a little.
CLOSE_M = 5e-5


def assert_same_shapes(built, committed):
    """The same nodes, and in each the same triangles in the world within `CLOSE_M`."""
    assert [i.name for i in built.instances] == [i.name for i in committed.instances]
    for mine, theirs in zip(built.instances, committed.instances, strict=True):
        here, there = _corners(built, mine), _corners(committed, theirs)
        assert abs(len(here) - len(there)) <= 0.01 * len(there), mine.name
        # corners, and the middles of triangles: the same points may be joined differently
        for one, other in ((here, there), (here.mean(axis=1), there.mean(axis=1))):
            one, other = one.reshape(-1, 3), other.reshape(-1, 3)
            assert cKDTree(one).query(other)[0].max() < CLOSE_M, mine.name
            assert cKDTree(other).query(one)[0].max() < CLOSE_M, mine.name


def _corners(scene, instance):
    """Corners (triangles, 3, xyz) in the world."""
    mesh = scene.meshes[instance.mesh]
    matrix = instance.world_from_mesh
    world = mesh.positions.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
    return world[mesh.triangles]
