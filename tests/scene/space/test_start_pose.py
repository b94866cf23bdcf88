"""Start poses of scenes that state none: clear of surfaces, and not inside of an object."""

import numpy as np
import pytest
import trimesh

from omnisim.scene import load_scene
from omnisim.scene.primitives import grid_triangles
from omnisim.scene.space.start_pose import default_start, find_start, nearest_points
from tests.scene.world_corners import solid_of

CLEARANCE_M = 0.25


def _box(extents, center):
    box = trimesh.creation.box(extents=extents)
    box.apply_translation(center)
    return box


def _room():
    """10 m × 8 m × 3 m, seen from inside."""
    room = _box((10, 8, 3), (0, 0, 1.5))
    room.invert()
    return room


def _sheet(corners):
    return trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)


def _load(folder, *parts, name="a.ply"):
    trimesh.util.concatenate(list(parts)).export(folder / name)
    return load_scene(folder / name)


def _distance(scene, point):
    """Distance of the nearest surface, by trimesh."""
    _, distances, _ = trimesh.proximity.closest_point_naive(solid_of(scene), [point])
    return float(distances[0])


WALL = [[0, -4, 0], [0, 4, 0], [0, 4, 3], [0, -4, 3]]
OBSTACLES = {
    "table top": _box((2, 1.2, 0.04), (0, 0, 1.0)),
    "wall": _box((0.2, 8, 3), (0, 0, 1.5)),
    "wall without thickness": _sheet(WALL),
    "wall beside the middle": _sheet(np.array(WALL) + [0.1, 0, 0]),
    "cabinet": _box((2, 2, 2), (0, 0, 1)),
    "block": _box((6, 6, 3), (0, 0, 1.5)),
}


@pytest.mark.parametrize("obstacle", OBSTACLES)
def test_a_start_is_clear_of_what_is_in_the_middle(obstacle, tmp_path):
    scene = _load(tmp_path, _room(), OBSTACLES[obstacle])
    x, y, z = scene.start.position_m
    assert _distance(scene, (x, y, z)) >= CLEARANCE_M - 1e-6
    assert z == pytest.approx(1.0)  # still at the height of the middle
    assert abs(x) < 5
    assert abs(y) < 4
    low, high = OBSTACLES[obstacle].bounds
    assert not np.all((low < (x, y, z)) & ((x, y, z) < high))
    assert scene.start.yaw_deg == 0.0


def test_the_middle_of_a_room_stays_the_start(tmp_path):
    table = _box((2, 1.2, 0.04), (0, 0, 0.6))
    assert _load(tmp_path, _room(), table).start.position_m == (0.0, 0.0, 1.0)
    assert default_start(np.array([[-1.0, -2, -1], [3, 2, 0]])).position_m == (1.0, 0.0, -0.5)


def test_a_floor_at_the_height_of_the_camera_is_stood_on(tmp_path):
    """A gallery through the whole room, 1 m up."""
    scene = _load(tmp_path, _room(), _box((9.9, 7.9, 0.04), (0, 0, 1.0)))
    assert scene.start.position_m == (0.0, 0.0, 1.5)


def test_a_flat_scene_is_seen_from_above(tmp_path):
    floor = _sheet([[-5, -5, 0], [5, -5, 0], [5, 5, 0], [-5, 5, 0]])
    assert _load(tmp_path, floor).start.position_m == (0.0, 0.0, 1.0)


def test_a_start_is_above_the_ground_of_a_hill(tmp_path):
    x, y = np.meshgrid(np.linspace(-50, 50, 101), np.linspace(-50, 50, 101))
    z = 10.0 * np.exp(-(x**2 + y**2) / 400.0)
    points = np.stack((x, y, z), axis=-1).reshape(-1, 3)
    scene = _load(tmp_path, trimesh.Trimesh(points, grid_triangles(101, 101), process=False))
    x, y, z = scene.start.position_m
    assert z - 10.0 * np.exp(-(x**2 + y**2) / 400.0) > CLEARANCE_M


def test_a_box_whose_walls_face_outwards_is_still_a_room(tmp_path):
    """Every point in it is inside of an object: the middle is as good as any."""
    assert _load(tmp_path, _box((10, 8, 3), (0, 0, 1.5))).start.position_m == (0.0, 0.0, 1.0)


def test_a_mirrored_instance_keeps_its_inside(tmp_path):
    scene = _load(tmp_path, _room(), OBSTACLES["block"])
    (instance,) = scene.instances
    matrix = np.diag((-1.0, 1.0, 1.0, 1.0)) @ instance.world_from_mesh
    object.__setattr__(instance, "world_from_mesh", matrix)
    x, y, _ = find_start(scene.meshes, scene.instances).position_m
    assert max(abs(x), abs(y)) > 3.0


def test_a_start_is_the_same_in_every_place(tmp_path):
    """A town in map coordinates: the same pose, moved."""
    parts = (_room(), OBSTACLES["table top"])
    here = np.array(_load(tmp_path, *parts, name="a.obj").start.position_m)
    for part in parts:
        part.apply_transform(trimesh.transformations.translation_matrix((2.6e6, 4e2, 1.2e6)))
    there = np.array(_load(tmp_path, *parts, name="b.obj").start.position_m)
    np.testing.assert_allclose(there - here, (2.6e6, -1.2e6, 4e2), atol=1e-3)


def test_distances_of_triangles_are_those_of_trimesh():
    rng = np.random.default_rng(3)
    corners = rng.normal(size=(500, 3, 3))
    corners[:20, 2] = corners[:20, 1]  # without area
    points = trimesh.triangles.closest_point(corners, np.zeros((500, 3)))
    np.testing.assert_allclose(nearest_points(corners)[0][20:], points[20:], atol=1e-12)
    expected = np.linalg.norm(points, axis=1)
    np.testing.assert_allclose(nearest_points(corners)[1][20:], expected[20:], atol=1e-12)
    lines = [np.linspace(a, b, 20001) for a, b in corners[:20, :2]]
    shortest = [np.linalg.norm(line, axis=1).min() for line in lines]
    np.testing.assert_allclose(nearest_points(corners)[1][:20], shortest, atol=1e-4)


def test_an_object_is_seen_from_outside_in_front_and_above(tmp_path):
    size_m = 0.9
    part = _box((size_m, 0.5 * size_m, 0.5 * size_m), (5, 5, 5))
    start = _load(tmp_path, part).start
    diagonal = np.sqrt(1.5) * size_m
    offset = np.array(start.position_m) - 5.0
    assert np.linalg.norm(offset) == pytest.approx(diagonal, rel=1e-4)  # the file is float32
    assert offset[1] < -0.9 * diagonal < 0.0 < offset[2]
    assert start.yaw_deg == 90.0
    heading = np.array((np.cos(np.pi / 2), np.sin(np.pi / 2), 0.0))
    assert heading @ -offset > 0.9 * diagonal
