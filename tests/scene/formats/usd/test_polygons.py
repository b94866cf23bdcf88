"""Triangulation of polygons, against their areas by the shoelace formula and trimesh."""

import numpy as np
import pytest
import trimesh

from omnisim.scene.formats.usd.gprims import (
    FaceCorners,
    PrimvarValues,
    integers,
    make_vertices,
    triangulate,
)


def _star(corners, seed):
    """Simple polygon of 2 * corners, concave at every second one."""
    angles = np.arange(2 * corners) * np.pi / corners
    radii = np.where(np.arange(2 * corners) % 2, 0.35, 1.0)
    radii *= np.random.default_rng(seed).uniform(0.8, 1.0, 2 * corners)
    return np.stack((radii * np.cos(angles), radii * np.sin(angles)), axis=1)


def _area(polygon):
    x, y = polygon.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def _mesh(polygon, rotation=None):
    points = np.concatenate((polygon, np.zeros((len(polygon), 1))), axis=1)
    points = points if rotation is None else points @ rotation.T
    corners, faces = triangulate(points, np.array([len(points)]), np.arange(len(points)))
    assert not faces.any()
    return trimesh.Trimesh(points, corners, process=False)


@pytest.mark.parametrize("corners", [3, 4, 5, 9, 40])
def test_concave_polygons_are_covered_once(corners):
    """Areas add up, and no triangle looks the other way: nothing is covered twice."""
    polygon = _star(corners, corners)
    rotation = trimesh.transformations.random_rotation_matrix(np.array([0.1, 0.6, 0.3]))[:3, :3]
    mesh = _mesh(polygon, rotation)
    assert mesh.area == pytest.approx(_area(polygon), rel=1e-9)
    assert (mesh.face_normals @ (rotation @ (0, 0, 1)) > 0.99).all()
    assert len(mesh.faces) == 2 * corners - 2


def test_a_concave_quad_is_cut_at_its_reflex_corner():
    for shift in range(4):
        arrow = np.roll([(0.0, 0.0), (1.0, -1.0), (0.0, 1.0), (-1.0, -1.0)], shift, axis=0)
        mesh = _mesh(arrow)
        assert mesh.area == pytest.approx(_area(arrow))
        assert (mesh.face_normals[:, 2] > 0.99).all()


def test_polygons_of_all_sizes_keep_their_order():
    points = np.random.default_rng(0).random((30, 3))
    counts = np.array([3, 5, 0, 2, 4, 3])
    corners, faces = triangulate(points, counts, np.arange(17))
    assert faces.tolist() == [0, 1, 1, 1, 4, 4, 5]
    assert corners[0].tolist() == [0, 1, 2]
    assert set(corners[faces == 4].ravel()) == {10, 11, 12, 13}
    assert corners[-1].tolist() == [14, 15, 16]


def test_polygons_without_an_area_end():
    flat = np.stack((np.arange(9.0), np.zeros(9)), axis=1)
    assert _mesh(flat).area == 0.0
    bow_tie = np.array([(0.0, 0), (2, 2), (2, 0), (0, 2), (-1, 1), (0.5, 0.7)])
    assert 1 <= len(_mesh(bow_tie).faces) <= 4


def test_a_wall_with_a_window_that_a_seam_leads_to():
    """Keyhole polygon, as CAD exports faces with holes."""
    outer = [(0, 0), (4, 0), (4, 3), (0, 3)]
    inner = [(1, 1), (1, 2), (3, 2), (3, 1)]
    seam = np.array([*outer, outer[0], inner[0], *inner[1:], inner[0]], dtype=float)
    assert _mesh(seam).area == pytest.approx(12.0 - 2.0)


def test_corners_share_vertices_as_far_as_their_values_are_equal():
    """Two triangles with an edge in common, whose normals differ and whose colors do not."""
    vertices, corners = np.array([0, 1, 2, 0, 2, 3]), np.arange(6).reshape(2, 3)
    found = FaceCorners.of(4, 2, vertices, corners, np.array([0, 1]))
    normals = PrimvarValues(np.array([(0.0, 0, 1), (0, 1, 0)]), "uniform")
    same = PrimvarValues(np.array([(-0.0, 0, 1), (0.0, 0, 1)]), "uniform")
    assert len(make_vertices(found, [normals, None]).points) == 6
    assert len(make_vertices(found, [same, None]).points) == 4
    too_few = PrimvarValues(np.zeros((3, 2)), "faceVarying")
    assert make_vertices(found, [too_few]).values == [None]
    by_corner = PrimvarValues(
        np.arange(12.0).reshape(6, 2), "faceVarying", np.array([0, 1, 2, 0, 2, 5])
    )
    made = make_vertices(found, [by_corner])
    assert len(made.points) == 4
    np.testing.assert_array_equal(made.points[made.triangles].ravel(), vertices)


@pytest.mark.parametrize("value", [None, "a", object(), [0.5], [None]])
def test_indices_of_another_type_are_none(value):
    assert integers(value).shape == (0,)
    assert integers([3, 1]).tolist() == [3, 1]
