import math

import numpy as np
import pytest

from omnisim.cameras.mirrors import HyperbolicMirror, tessellate
from omnisim.cameras.mirrors.mirror_mesh import PAPER_POLYGON_COUNTS, sectors_and_rings
from omnisim.core.errors import OpticsError


@pytest.mark.parametrize("polygons", PAPER_POLYGON_COUNTS)
def test_paper_counts_split_four_to_one(polygons):
    n = int(math.log2(polygons))
    assert sectors_and_rings(polygons) == (2 ** (n // 2 + 1), 2 ** (n // 2 - 1))


@pytest.mark.parametrize("polygons", [8, 12, 100, 1000, *PAPER_POLYGON_COUNTS])
def test_mesh_lies_on_the_mirror_and_faces_the_pinhole(polygons):
    mirror = HyperbolicMirror()
    mesh = tessellate(mirror, polygons)
    assert mesh.sectors * mesh.rings == mesh.polygons == polygons
    assert len(mesh.triangles) == mesh.sectors * (2 * mesh.rings - 1)
    assert np.abs(mirror.equation_residual(mesh.vertices_m)).max() < 1e-12
    assert np.linalg.norm(mesh.vertices_m[:, :2], axis=1).max() == pytest.approx(
        mirror.rim_radius_m, rel=1e-14
    )
    a, b, c = np.moveaxis(mesh.vertices_m[mesh.triangles], 1, 0)
    flat_normals = np.cross(b - a, c - a)
    towards_pinhole = np.array([0.0, 0.0, mirror.c_m]) - a
    assert np.all(np.sum(flat_normals * towards_pinhole, axis=1) > 0.0)
    assert np.all(np.sum(flat_normals * mesh.normals[mesh.triangles[:, 0]], axis=1) > 0.0)


def test_mesh_is_one_disc_without_cracks():
    """Every edge belongs to two triangles that run along it in opposite ways, but at the rim."""
    mesh = tessellate(HyperbolicMirror(), 256)
    edges = mesh.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    directed = {tuple(edge) for edge in edges.tolist()}
    assert len(directed) == len(edges)
    border = [edge for edge in directed if edge[::-1] not in directed]
    assert len(border) == mesh.sectors
    first_rim_vertex = len(mesh.vertices_m) - mesh.sectors
    assert min(min(edge) for edge in border) == first_rim_vertex


@pytest.mark.parametrize(
    ("polygons", "words"),
    [
        (4, "expected 8 to"),
        (0, "expected 8 to"),
        (-16, "expected 8 to"),
        (10**9, "expected 8 to"),
        (1009, "nearest 1008 and 1012"),
    ],
)
def test_impossible_counts_name_the_possible(polygons, words):
    with pytest.raises(OpticsError, match=words):
        tessellate(HyperbolicMirror(), polygons)
