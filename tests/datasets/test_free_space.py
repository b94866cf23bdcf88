"""Free floors, against distances that trimesh measures."""

import dataclasses

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from omnisim.core.errors import PlanError
from omnisim.datasets import free_space
from omnisim.datasets.free_space import MARGIN_CELLS, find_free_space, surface_points
from omnisim.datasets.generate.distributions import RandomStream
from omnisim.scene import Scene, load_scene
from omnisim.scene.model import StartPose
from omnisim.scene.space.floor import triangles_within
from tests.slow import slow_but

RADIUS_M, HEIGHT_M, STEP_M = 0.25, 0.8, 0.05


def _room(*boxes):
    """Floor of 4 m × 4 m with boxes: extents and centers."""
    floor = trimesh.creation.box((4.0, 4.0, 0.1))
    floor.apply_translation((0.0, 0.0, -0.05))
    parts = trimesh.Scene({"floor": floor})
    for index, (size, middle) in enumerate(boxes):
        box = trimesh.creation.box(size)
        box.apply_translation(middle)
        parts.add_geometry(box, node_name=f"box{index}")
    return Scene.from_trimesh(parts)


def _distances(scene, points, low_z, high_z):
    """Distance on the floor plan of points (n, 2) from the surfaces between two heights."""
    corners = triangles_within(scene, points.min(axis=0) - 1.0, points.max(axis=0) + 1.0).corners_m
    z = corners[..., 2]
    corners = corners[(z.max(axis=1) > low_z) & (z.min(axis=1) < high_z)]
    mesh = trimesh.Trimesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
    samples = trimesh.sample.sample_surface(mesh, 300_000, seed=1)[0]
    samples = samples[(samples[:, 2] > low_z) & (samples[:, 2] < high_z)]
    return cKDTree(samples[:, :2]).query(points)[0]


def _drawn(free, count=300):
    stream, places = RandomStream(1), free.free_cells()
    cells = [places[stream.whole(len(places))] for _ in range(count)]
    return np.array([free.point_in(cell, (stream.share(), stream.share())) for cell in cells])


@pytest.mark.parametrize("name", slow_but(["courtyard", "soccer"], "soccer"))
def test_no_surface_is_within_the_radius(name):
    scene = load_scene(name)
    free = find_free_space(scene, RADIUS_M, HEIGHT_M, STEP_M)
    points = _drawn(free)
    floor_m = float(np.nanmedian(free.floor_m[free.is_free]))
    np.testing.assert_allclose(points[:, 2], floor_m, atol=STEP_M + 0.1)
    distances = _distances(scene, points[:, :2], points[:, 2].max() + STEP_M, floor_m + HEIGHT_M)
    assert distances.min() >= RADIUS_M


def test_a_box_takes_its_place_and_the_margin():
    scene = _room(((1.0, 1.0, 0.5), (0.0, 0.0, 0.25)))
    free = find_free_space(scene, RADIUS_M, HEIGHT_M, STEP_M, floor_m=0.0, from_start=False)
    assert not free.is_free_at(np.array((0.7, 0.0)))
    clear_m = 0.5 + RADIUS_M + (MARGIN_CELLS + 1.5) * free.cell_m
    assert free.is_free_at(np.array((clear_m, 0.0)))
    assert free.is_free_at(np.array((0.0, -clear_m)))
    for cell, is_free in np.ndenumerate(free.is_free):
        assert free.clears(cell, RADIUS_M) == is_free

    # low things and high things do not count
    scene = _room(((1.0, 1.0, 0.04), (0.0, 0.0, 0.02)), ((1.0, 1.0, 0.1), (0.0, 0.0, 0.9)))
    free = find_free_space(scene, RADIUS_M, HEIGHT_M, STEP_M, floor_m=0.0)
    assert free.is_free_at(np.zeros(2))
    under = find_free_space(scene, RADIUS_M, 0.9, STEP_M, floor_m=0.0)
    assert not under.is_free_at(np.zeros(2))


def test_what_a_wall_parts_from_the_start_is_left_out():
    scene = _room(((0.1, 4.0, 2.0), (0.5, 0.0, 1.0)))
    start = np.array(scene.start.position_m[:2])
    free = find_free_space(scene, RADIUS_M, HEIGHT_M, STEP_M, floor_m=0.0)
    both = find_free_space(scene, RADIUS_M, HEIGHT_M, STEP_M, floor_m=0.0, from_start=False)
    sides = np.array([[-1.0, 0.0], [1.3, 0.0]])
    assert [both.is_free_at(side) for side in sides] == [True, True]
    assert [free.is_free_at(side) for side in sides] == [bool(start[0] < 0.5), bool(start[0] > 0.5)]


def test_a_window_has_what_the_whole_floor_plan_has(monkeypatch):
    """A pen on a floor: a window that is too small, and one that is large enough."""
    walls = [((0.1, 1.8, 1.0), (0.9, 0.0, 0.5)), ((0.1, 1.8, 1.0), (-0.9, 0.0, 0.5))]
    walls += [(size[1::-1] + (1.0,), (y, x, z)) for size, (x, y, z) in walls]
    scene = dataclasses.replace(_room(*walls), start=StartPose((0.1, 0.2, 0.5)))
    found = []
    for halves in ((), (15, 34), (34,)):
        monkeypatch.setattr(free_space, "WINDOW_CELLS", halves)
        found.append(find_free_space(scene, 0.15, HEIGHT_M, STEP_M, floor_m=0.0))
    whole, *windows = found
    for window in windows:
        assert window.is_free.shape != whole.is_free.shape
        places = (free.low_m + free.cell_m * free.free_cells()[:, ::-1] for free in (window, whole))
        np.testing.assert_allclose(*places, atol=1e-12)
        for cell, same in zip(window.free_cells(), whole.free_cells(), strict=True):
            assert window.floor_m[tuple(cell)] == whole.floor_m[tuple(same)]
            assert window.clearance_m[tuple(cell)] <= whole.clearance_m[tuple(same)]


def test_no_floor_is_one_line():
    with pytest.raises(PlanError, match=r"no free floor at 7 m for a radius of 0\.25 m") as caught:
        find_free_space(_room(), RADIUS_M, HEIGHT_M, STEP_M, floor_m=7.0)
    assert "\n" not in str(caught.value)


def test_points_are_dense_on_triangles():
    corners = np.random.default_rng(2).uniform(-1.0, 1.0, (20, 3, 3))
    found = np.concatenate(list(surface_points(corners, 0.1)))
    weights = np.random.default_rng(3).dirichlet((0.5, 0.5, 0.5), (20, 200))
    inside = np.einsum("nks,nsc->nkc", weights, corners).reshape(-1, 3)
    assert cKDTree(found).query(inside)[0].max() <= 0.1 * 2.0 / 3.0 + 1e-9
