"""Heights of what is seen from above, and the hierarchy of bounds that finds it."""

import dataclasses

import numpy as np
import pytest

from omnisim.core.poses import pose
from omnisim.scene import load_scene
from omnisim.scene.model import Material
from omnisim.scene.space.floor import HeightField, TriangleBvh, floor_height_m, triangles_within
from tests.embree_oracle import RayCaster
from tests.scenes import scene_of, square, with_warehouse


def test_nearest_surface_seen_from_above():
    scene = scene_of([square(z_m=z) for z in (-3.0, -0.09, 0.7)])
    assert floor_height_m(scene, (1.0, 1.0)) == -0.09
    assert floor_height_m(scene, (1.0, 1.0), near_m=0.4) == 0.7
    assert floor_height_m(scene, (6.0, 1.0)) is None


@pytest.mark.parametrize(("flips", "found"), [((1, 1, 1), None), ((1, -1, 1), 0.5)])
def test_undersides_are_no_floor(flips, found):
    """Unless both sides are drawn; a mirroring matrix turns the winding, not the front."""
    ceiling = dataclasses.replace(square(), triangles=square().triangles[:, ::-1])
    at = pose((0.0, 0.0, 0.5)) @ np.diag([*flips, 1.0])
    assert floor_height_m(scene_of([ceiling], [Material()], [at]), (1.0, 1.0)) is None
    assert floor_height_m(scene_of([square()], [Material()], [at]), (1.0, 1.0)) == 0.5
    assert floor_height_m(scene_of([ceiling], None, [at]), (1.0, 1.0)) == 0.5


def test_a_point_on_an_edge_is_on_the_floor():
    scene = scene_of([square(half_m=0.7)], poses=[pose(yaw_deg=33.0)])
    along = np.linspace(-0.69, 0.69, 1001)[:, None] * (
        scene.instances[0].world_from_mesh[:2, :2] @ (1, 1)
    )
    heights = HeightField(scene, along[0], along[-1]).heights_m(along[:, None])
    np.testing.assert_array_equal(heights.max(axis=2), 0.0)


@with_warehouse("courtyard")
def test_highest_surfaces_are_embree_s(source):
    """Both sides drawn, as Embree sees both."""
    scene = load_scene(source)
    materials = tuple(
        dataclasses.replace(material, double_sided=True) for material in scene.materials
    )
    scene = dataclasses.replace(scene, materials=materials)
    oracle = RayCaster(scene)
    low, high = scene.bounds_m()
    low, high = np.maximum(low, -12.0), np.minimum(high, 12.0)
    points = np.random.default_rng(5).uniform(low[:2], high[:2], (500, 2))
    found = HeightField(scene, low[:2], high[:2]).heights_m(points[:, None])[:, 0, -1]
    down = np.array([[0.0, 0.0, -1.0]])
    top = high[2] + 40.0
    theirs = [top - oracle.ranges(np.array([x, y, top]), down)[0] for x, y in points]
    # float32 decides which of two triangles is hit, at their edges
    agree = np.isclose(found, theirs, atol=2e-4) | (found == theirs)
    assert agree.mean() > 0.99


@pytest.mark.parametrize("count", [0, 1, 5, 3000])
def test_overlaps_are_those_of_all_pairs(count):
    random = np.random.default_rng(count)
    corners = random.uniform(-3.0, 3.0, (count, 1, 3)) + random.normal(0.0, 0.2, (count, 3, 3))
    low = random.uniform(-3.0, 3.0, (40, 3))
    high = low + random.uniform(0.0, 1.0, (40, 3))
    low[::4, 2], high[::4, 2] = -np.inf, np.inf
    boxes, triangles = TriangleBvh(corners).overlaps(low, high)
    meets = np.all(corners.min(axis=1) <= high[:, None], axis=2)
    meets &= np.all(corners.max(axis=1) >= low[:, None], axis=2)
    np.testing.assert_array_equal(np.stack((boxes, triangles)), np.nonzero(meets))


def test_triangles_within_a_part_of_the_floor_plan():
    scene = scene_of(
        [square(half_m=1.0), square(half_m=1.0)], poses=[pose(), pose((5.0, 0.0, 9.0))]
    )
    found = triangles_within(scene, np.array([4.5, -0.5]), np.array([5.5, 0.5]))
    assert set(found.instances.tolist()) == {1}
    assert len(found.corners_m) == 2
