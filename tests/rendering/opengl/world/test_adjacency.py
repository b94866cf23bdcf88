"""Adjacency of triangles."""

import numpy as np

from omnisim.rendering.opengl.world.geometry_store import NO_NEIGHBOR, neighbors
from tests.vehicles import box


def test_every_edge_of_a_box_has_the_triangle_beyond_it():
    """Though every side has corners of its own."""
    mesh = box("box", 0)
    found = neighbors(mesh.positions, mesh.triangles)
    assert found.shape == (12, 3)
    for triangle in range(12):
        for corner in range(3):
            other = found[triangle, corner]
            assert other != triangle
            edge = np.delete(mesh.positions[mesh.triangles[triangle]], corner, axis=0)
            there = {tuple(point) for point in mesh.positions[mesh.triangles[other]].tolist()}
            assert {tuple(point) for point in edge.tolist()} <= there
            assert triangle in found[other]


def test_open_edges_have_none_and_crowded_ones_go_round():
    positions = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1]], np.float32)
    fan = np.array([[0, 1, 2], [0, 1, 3], [1, 0, 4]], dtype=np.uint32)  # all at one edge
    found = neighbors(positions, fan)
    assert found[:, 2].tolist() == [1, 2, 0]
    assert (found[:, :2] == NO_NEIGHBOR).all()
    turned = neighbors(positions + np.float32(-0.0), fan)
    np.testing.assert_array_equal(found, turned)


def test_without_triangles_nothing_lies_beside_anything():
    found = neighbors(np.ones((5, 3), np.float32), np.empty((0, 3), np.uint32))
    assert found.shape == (0, 3)
    assert found.dtype == np.uint32
