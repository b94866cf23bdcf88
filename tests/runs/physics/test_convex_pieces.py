"""Convex pieces of scenes: solids, hollow rooms, and slabs behind floors and walls."""

import numpy as np
import pytest
import trimesh
from scipy.spatial import Delaunay

from omnisim.runs.physics.convex_pieces import (
    SLAB_M,
    SolidRegion,
    area_vectors,
    convex_facets,
    convex_pieces,
    hull_of,
)
from omnisim.scene import Scene, load_scene
from tests.runs.physics.worlds import rover, solid
from tests.slow import slow_but


def _pieces(scene, *free_points_m):
    region = SolidRegion(np.full(3, -50.0), np.full(3, 50.0), np.reshape(free_points_m, (-1, 3)))
    return convex_pieces(scene, region)


def _inside(pieces, points_m):
    """Mask of the points within any piece, by SciPy's triangulation of its vertices."""
    hulls = [Delaunay(piece.shape.vertices_m + piece.shape.center_m) for piece in pieces]
    return np.any([hull.find_simplex(points_m) >= 0 for hull in hulls], axis=0)


def _inward(extents_m):
    mesh = trimesh.creation.box(extents_m)
    mesh.invert()
    return Scene.from_arrays("room", mesh.vertices, mesh.faces, double_sided=False)


@pytest.mark.parametrize(
    ("mesh", "kind"),
    [
        (trimesh.creation.box((1.0, 2.0, 3.0)), "box"),
        (trimesh.creation.icosphere(3, 0.5), "ball"),
        (trimesh.creation.cylinder(0.5, 1.0), "hull"),
    ],
    ids=["box", "ball", "cylinder"],
)
def test_convex_solids_are_one_piece_of_their_volume(mesh, kind):
    mesh.apply_transform(trimesh.transformations.euler_matrix(0.3, 0.5, 0.8))
    (piece,) = _pieces(solid(mesh))
    assert piece.shape.kind == kind
    corners = piece.shape.vertices_m + piece.shape.center_m
    assert trimesh.convex.convex_hull(corners).volume == pytest.approx(mesh.volume, rel=1e-6)
    if kind == "box":
        assert np.prod(2.0 * piece.shape.half_m) == pytest.approx(mesh.volume, rel=1e-6)


def test_rooms_stay_hollow():
    pieces = _pieces(_inward((4.0, 5.0, 3.0)))
    assert len(pieces) == 6
    inside = np.random.default_rng(1).uniform(-0.99, 0.99, (200, 3)) * (2.0, 2.5, 1.5)
    assert not _inside(pieces, inside).any()
    assert _inside(pieces, [[2.0 + 0.5 * SLAB_M, 0.0, 0.0], [0.0, 0.0, -1.5 - 0.5 * SLAB_M]]).all()


def test_solids_around_the_path_are_hollow():
    pen = solid(trimesh.creation.box((4.0, 5.0, 3.0)))
    assert len(_pieces(pen)) == 1
    pieces = _pieces(pen, (0.0, 0.0, 0.0))
    assert len(pieces) == 6
    assert not _inside(pieces, np.zeros((1, 3))).any()


def test_concave_solids_are_not_their_hulls():
    tunnel = trimesh.creation.annulus(1.0, 1.2, 4.0)
    pieces = _pieces(solid(tunnel))
    assert len(pieces) > 10
    along = np.column_stack((np.zeros((9, 2)), np.linspace(-2.5, 2.5, 9)))
    assert not _inside(pieces, along).any()
    (small,) = _pieces(solid(trimesh.creation.annulus(0.1, 0.15, 0.1)))
    assert small.shape.kind == "hull"  # small parts are their hulls


@pytest.mark.parametrize("flipped", [False, True])
def test_floors_with_two_sides_are_slabs_below_their_surface(flipped):
    triangles = np.array([(0, 1, 2), (0, 2, 3)])
    corners = [(-1, -1, 0.3), (1, -1, 0.3), (1, 1, 0.3), (-1, 1, 0.3)]
    floor = Scene.from_arrays("floor", corners, triangles[:, ::-1] if flipped else triangles)
    (piece,) = _pieces(floor)
    assert piece.shape.kind == "box"
    low = piece.shape.center_m[2] - np.abs(piece.shape.axes @ np.diag(piece.shape.half_m))[2].sum()
    assert low == pytest.approx(0.3 - SLAB_M)


def test_flat_surfaces_are_cut_into_few_convex_polygons_of_the_same_area():
    grid = np.array([(x, y, 0.0) for x in range(7) for y in range(7)], dtype=float)
    cells = [(x, y) for x in range(6) for y in range(6) if not (2 <= x < 4 and 2 <= y < 4)]
    faces = []
    for x, y in cells:
        a = 7 * x + y
        faces += [(a, a + 7, a + 8), (a, a + 8, a + 1)]
    facets = convex_facets(grid, np.array(faces))
    assert 4 <= len(facets) <= 8
    areas = [np.linalg.norm(area_vectors(grid[facet]).sum(axis=0)) for facet in facets]
    assert sum(areas) == pytest.approx(len(cells))
    middle = np.array([[3.0, 3.0, 0.0]])
    for facet in facets:
        corners = grid[facet].reshape(-1, 3)
        hull = trimesh.convex.convex_hull(np.concatenate((corners, corners - (0, 0, 1))))
        assert not hull.contains(middle - (0.0, 0.0, 0.5)).any()


def test_flat_things_have_no_hull_and_parts_out_of_the_region_are_left_out():
    assert hull_of(Scene.from_arrays("a", np.eye(3), [(0, 1, 2)])) is None
    region = SolidRegion(np.array([5.0, 5.0, 5.0]), np.full(3, 9.0), np.zeros((0, 3)))
    assert convex_pieces(solid(trimesh.creation.box((1.0, 1.0, 1.0))), region) == []


@pytest.mark.parametrize(("flatness", "two_sided"), [(1.0, True), (1e-2, False), (1e-5, True)])
def test_any_triangles_are_pieces_that_mujoco_takes_without_a_word(flatness, two_sided, capfd):
    mujoco = pytest.importorskip("mujoco", reason="MuJoCo, an extra, is not installed")
    from omnisim.runs.physics.simulation import WorldModel

    random = np.random.default_rng(7)
    sizes = 10.0 ** random.uniform(-4.0, 2.0, (200, 1, 1))
    corners = random.uniform(-20.0, 20.0, (200, 1, 3)) + sizes * random.normal(size=(200, 3, 3))
    corners[:, 2] = corners[:, :2].mean(axis=1) + flatness * random.normal(size=(200, 3))
    soup = Scene.from_arrays(
        "soup", corners.reshape(-1, 3), np.arange(600).reshape(-1, 3), double_sided=two_sided
    )
    pieces = convex_pieces(soup, SolidRegion.everywhere())
    model = WorldModel.of(pieces, {}, {"cart": (rover(), np.eye(4))}).spec.compile()
    mujoco.mj_step(model, mujoco.MjData(model))
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    "name", slow_but(["soccer", "mapping", "courtyard"], long=["soccer", "mapping"])
)
def test_shipped_scenes_are_open_above_their_starts(name):
    scene = load_scene(name)
    starts = [start.position_m for start in scene.starts] or [scene.start.position_m]
    points = np.array(starts) + (0.0, 0.0, 0.3)
    region = SolidRegion(points.min(axis=0) - 3.0, points.max(axis=0) + 3.0, points)
    assert not _inside(convex_pieces(scene, region), points).any()
