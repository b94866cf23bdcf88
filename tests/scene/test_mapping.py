"""The built-in scene `mapping`: its extent, and the four start poses that are known."""

import numpy as np
import pytest
import trimesh
from PIL import Image, ImageDraw

from omnisim.scene import load_scene
from omnisim.scene.space.floor import floor_height_m
from omnisim.scene.space.start_pose import nearest_points
from tests.scene.world_corners import corners_of

KNOWN_STARTS = ((0.75, -7.28), (3.63, 10.80), (1.91, 10.00), (3.85, 9.17))
FREE_RADIUS_M = 0.45


@pytest.fixture(scope="module")
def scene():
    return load_scene("mapping")


def _between(scene, low_m, high_m):
    """Triangles (n, 3, 3) of all surfaces, cut at two heights."""
    corners = corners_of(scene).reshape(-1, 3)
    faces = np.arange(len(corners)).reshape(-1, 3)
    for height_m, up in ((low_m, 1.0), (high_m, -1.0)):
        plane = (0.0, 0.0, up), (0.0, 0.0, height_m)
        corners, faces, *_ = trimesh.intersections.slice_faces_plane(corners, faces, *plane)
    return corners[faces]


def test_floors_extend_more_than_18_m(scene):
    floors = [name for name in scene.instance_names if name.startswith("floor_")]
    corners = np.concatenate([corners_of(scene, name) for name in floors]).reshape(-1, 3)
    low, high = corners.min(axis=0), corners.max(axis=0)
    np.testing.assert_allclose((low, high), ((-4.0, -9.0, 0.0), (11.0, 13.0, 0.0)), atol=1e-4)


def test_starts_are_the_known_ones_on_the_floor(scene):
    assert [start.position_m for start in scene.starts] == [(x, y, 0.0) for x, y in KNOWN_STARTS]
    for start in KNOWN_STARTS:
        assert floor_height_m(scene, start) == pytest.approx(0.0, abs=1e-5)


def test_starts_are_free(scene):
    flat = _between(scene, 0.02, 1.0) * (1.0, 1.0, 0.0)
    for start in KNOWN_STARTS:
        assert nearest_points(flat - (*start, 0.0))[1].min() > FREE_RADIUS_M


@pytest.mark.slow
def test_a_robot_can_drive_into_every_room(scene):
    """A disc of its half width passes furniture and open doors, from the first start."""
    cell, margin = 0.04, 0.26  # the robot is 0.5 m wide
    low, size = np.array([-4.5, -9.5]), (400, 575)
    image = Image.new("1", size)
    draw = ImageDraw.Draw(image)
    for triangle in _between(scene, 0.06, 1.0):
        pixels = (triangle[:, :2] - low) / cell
        if (pixels > 0).all() and (pixels < size).all():
            draw.polygon([tuple(p) for p in pixels], fill=1, outline=1)
    reach = round(margin / cell)
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    blocked = _spread(np.asarray(image), np.argwhere(x**2 + y**2 <= reach**2) - reach)
    reached = np.zeros_like(blocked)
    column, row = ((np.array(KNOWN_STARTS[0]) - low) / cell).astype(int)
    reached[row, column] = True
    count = 0
    while reached.sum() != count:
        count = reached.sum()
        for _ in range(20):
            reached = _spread(reached, [(0, 0), (0, 1), (1, 0), (0, -1), (-1, 0)]) & ~blocked
    for name in (one for one in scene.instance_names if one.startswith("floor_")):
        corners = ((corners_of(scene, name).reshape(-1, 3)[:, :2] - low) / cell).astype(int)
        (left, top), (right, bottom) = corners.min(axis=0), corners.max(axis=0)
        assert reached[top:bottom, left:right].sum() * cell**2 > 0.8, name


def _spread(cells, offsets):
    """Cells that are set, and those beside them by the offsets (row, column)."""
    spread = np.zeros_like(cells)
    for row, column in offsets:
        spread |= np.roll(cells, (row, column), axis=(0, 1))
    return spread
