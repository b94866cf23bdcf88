"""The built-in scene `mapping`: its extent, and the four start poses that are known."""

import numpy as np
import pytest
from PIL import Image, ImageDraw

from omnisim.scene import load_scene
from tests.slow import slow_but

KNOWN_STARTS = ((0.75, -7.28), (3.63, 10.80), (1.91, 10.00), (3.85, 9.17))
FREE_RADIUS_M = 0.45
FREE_HEIGHTS_M = (0.02, 1.0)


@pytest.fixture(scope="module")
def scene():
    return load_scene("mapping")


@pytest.fixture(scope="module")
def triangles(scene):
    """Corners (n, 3, 3) of all triangles in the world."""
    found = []
    for instance in scene.instances:
        mesh, pose = scene.meshes[instance.mesh], instance.world_from_mesh
        corners = mesh.positions[mesh.triangles].astype(float)
        found.append(corners @ pose[:3, :3].T + pose[:3, 3])
    return np.concatenate(found)


def test_floors_extend_more_than_18_m(scene):
    poses = {i.name: (scene.meshes[i.mesh], i.world_from_mesh) for i in scene.instances}
    corners = np.concatenate(
        [
            mesh.positions @ pose[:3, :3].T + pose[:3, 3]
            for name, (mesh, pose) in poses.items()
            if name.startswith("floor_")
        ]
    )
    low, high = corners.min(axis=0), corners.max(axis=0)
    np.testing.assert_allclose(low[:2], (-4.0, -9.0), atol=1e-4)
    np.testing.assert_allclose(high[:2], (11.0, 13.0), atol=1e-4)
    np.testing.assert_allclose([low[2], high[2]], 0.0, atol=1e-5)
    assert high[1] - low[1] > 18.0


def test_starts_are_the_known_ones(scene):
    assert tuple(start.position_m for start in scene.starts) == tuple(
        (x, y, 0.0) for x, y in KNOWN_STARTS
    )


@pytest.mark.parametrize("start", slow_but(KNOWN_STARTS, KNOWN_STARTS[0]))
def test_start_is_free(triangles, start):
    clipped = _between(triangles, *FREE_HEIGHTS_M)
    distances = [_distance(polygon[:, :2] - start) for polygon in clipped]
    assert min(distances) > FREE_RADIUS_M


@pytest.mark.parametrize("start", KNOWN_STARTS)
def test_floor_lies_beneath_start(triangles, start):
    heights = [
        corners[:, 2].mean()
        for corners in triangles
        if np.ptp(corners[:, 2]) < 1e-6
        and corners[0, 2] < 0.5
        and _distance(corners[:, :2] - start) == 0.0
        and _area(corners[:, :2]) > 0.0  # faces up
    ]
    assert max(heights) == pytest.approx(0.0, abs=1e-5)


@pytest.mark.slow
def test_a_robot_can_drive_into_every_room(scene, triangles):
    """A disc of its half width passes furniture and open doors, from the first start."""
    cell, margin = 0.05, 0.27  # the robot is 0.5 m wide
    low, size = np.array([-4.5, -9.5]), (320, 460)
    image = Image.new("1", size)
    draw = ImageDraw.Draw(image)
    for polygon in _between(triangles, 0.06, 1.0):
        pixels = (polygon[:, :2] - low) / cell
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
    for instance in scene.instances:
        if instance.name.startswith("floor_"):
            mesh, pose = scene.meshes[instance.mesh], instance.world_from_mesh
            corners = mesh.positions @ pose[:3, :3].T + pose[:3, 3]
            first, last = ((corners[:, :2] - low) / cell).astype(int)[[0, 2]]
            inside = reached[
                slice(*sorted((first[1], last[1]))), slice(*sorted((first[0], last[0])))
            ]
            assert inside.sum() * cell**2 > 0.8, instance.name


def _spread(cells, offsets):
    """Cells that are set, and those beside them by the offsets (row, column)."""
    spread = np.zeros_like(cells)
    for row, column in offsets:
        spread |= np.roll(cells, (row, column), axis=(0, 1))
    return spread


def _between(triangles, low, high):
    """Parts of triangles between two heights, as polygons (k, 3)."""
    z = triangles[..., 2]
    kept = []
    for polygon in triangles[(z.min(axis=1) < high) & (z.max(axis=1) > low)]:
        for level, sign in ((low, 1.0), (high, -1.0)):
            polygon = _cut(polygon, sign * (polygon[:, 2] - level))
        if len(polygon):
            kept.append(polygon)
    return kept


def _cut(polygon, heights):
    """The part of a convex polygon where `heights`, linear over it, is not negative."""
    corners = []
    count = len(polygon)
    for k in range(count):
        here, after = heights[k], heights[(k + 1) % count]
        if here >= 0.0:
            corners.append(polygon[k])
        if here * after < 0.0:
            corners.append(
                polygon[k] + (polygon[(k + 1) % count] - polygon[k]) * here / (here - after)
            )
    return np.array(corners)


def _distance(polygon):
    """Distance from the origin to a convex polygon (k, 2); 0 inside."""
    starts, edges = polygon, np.roll(polygon, -1, axis=0) - polygon
    turns = edges[:, 0] * -starts[:, 1] + edges[:, 1] * starts[:, 0]
    if np.abs(turns).max() > 1e-9 and ((turns >= 0).all() or (turns <= 0).all()):
        return 0.0
    lengths = np.maximum((edges**2).sum(axis=1), 1e-18)
    share = np.clip(-(starts * edges).sum(axis=1) / lengths, 0.0, 1.0)
    return np.linalg.norm(starts + share[:, None] * edges, axis=1).min()


def _area(polygon):
    """Twice the signed area of a triangle."""
    (ax, ay), (bx, by) = polygon[1] - polygon[0], polygon[2] - polygon[0]
    return ax * by - ay * bx
