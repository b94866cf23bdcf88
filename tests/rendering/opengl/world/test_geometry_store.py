"""Vertices, indices and triangles of a scene's meshes, beside the arrays of its meshes."""

import numpy as np
import pytest

from omnisim.cameras import EquidistantCamera
from omnisim.core.poses import pose
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.opengl.gl.buffers import read_buffer
from omnisim.rendering.opengl.world import geometry_store, scene_buffers
from omnisim.rendering.opengl.world.geometry_store import NO_NEIGHBOR, neighbors
from omnisim.rendering.opengl.world.scene_buffers import SceneBuffers
from omnisim.rendering.opengl.world.vertex_records import VERTEX
from omnisim.rendering.stage import Stage, open_sensor
from omnisim.scene import Scene
from omnisim.scene.model import AlphaMode, Material
from omnisim.sensors.laser_scanner.laser_scanner import LaserScanner
from tests.rendering.opengl.sheets import dynamic_object, mixed_scene, sheet
from tests.scenes import scene_of
from tests.vehicles import box, surroundings


@pytest.fixture
def uploaded(monkeypatch):
    """Meshes whose vertices are uploaded, in turn."""
    meshes, vertices = [], geometry_store._vertices

    def record(mesh):
        meshes.append(mesh)
        return vertices(mesh)

    monkeypatch.setattr(geometry_store, "_vertices", record)
    return meshes


def test_meshes_are_uploaded_once_and_the_rest_is_left_as_it_is(context, uploaded):
    buffers = SceneBuffers(context, surroundings())
    item = buffers.draw_items[1]
    vertices, indices = buffers.buffers_of(np.array([1, 1]))
    assert uploaded == [item.mesh]
    place = VERTEX.itemsize * item.base
    marked = np.full(VERTEX.itemsize, 7, dtype=np.uint8)
    vertices.write(marked, offset=place)  # as the GPU does, which deforms meshes
    assert (buffers.vertices, buffers.indices) == (vertices, indices)
    assert len(uploaded) == len({one.base for one in buffers.draw_items})
    assert read_buffer(vertices)[place : place + VERTEX.itemsize] == marked.tobytes()
    made = np.frombuffer(read_buffer(vertices), dtype=VERTEX)["in_position"]
    corners = np.frombuffer(read_buffer(indices), dtype="<u4")
    for other in buffers.draw_items[2:]:
        own = corners[other.first : other.first + other.count]
        expected = other.mesh.positions[other.mesh.triangles.ravel()]
        assert np.array_equal(made[own], expected)


def test_opaque_meshes_are_uploaded_for_ground_truth_only(needs_opengl, uploaded):
    ground = Scene.from_arrays("ground", [[-9, -9, 0], [9, -9, 0], [0, 9, 0]], [[0, 1, 2]])
    lens = EquidistantCamera(16, 16, 5.0, (7.5, 7.5), theta_max_rad=1.6)
    with open_sensor(ground, OmniCamera(lens)) as camera:
        camera.render(pose((0.0, 0.0, 1.0)))
        assert not uploaded
        camera.render(pose((0.0, 0.0, 1.0)), also=("range",))
        assert uploaded


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


MATERIALS = [Material(), Material(alpha_mode=AlphaMode.BLEND)]


def _entries(table):
    return np.frombuffer(table.corners.read(), dtype=[("at", "<f4", 3), ("beside", "<u4")])


def test_corners_are_those_of_the_index_buffer_with_their_neighbors(context):
    # more than a row of the texture
    meshes = [sheet("large", 0, side=40), box("small", 0), box("glass", 1)]
    buffers = SceneBuffers(context, scene_of(meshes, MATERIALS))
    entries = _entries(buffers.triangles)
    for draw in buffers.draw_items:
        part = entries[draw.first : draw.first + draw.count]
        mesh = draw.mesh
        np.testing.assert_array_equal(part["at"], mesh.positions[mesh.triangles.ravel()])
        beside = part["beside"].reshape(-1, 3)
        if mesh.name == "glass":
            assert (beside == NO_NEIGHBOR).all()
        else:
            np.testing.assert_array_equal(beside, neighbors(mesh.positions, mesh.triangles))


def test_indices_stay_in_order_where_images_sort_them(context):
    opaque = SceneBuffers(context, scene_of([box("box", 0)], MATERIALS))
    assert opaque.triangles.indices is opaque.indices
    buffers = SceneBuffers(context, scene_of([box("box", 0), box("glass", 1)], MATERIALS))
    before = read_buffer(buffers.indices)
    (glass,) = (draw for draw in buffers.draw_items if draw.mesh.name == "glass")
    viewpoint_from_mesh = np.eye(4)
    viewpoint_from_mesh[:3, 3] = 0.3, 2.0, 5.0
    buffers.sort_triangles(glass, viewpoint_from_mesh)
    assert read_buffer(buffers.indices) != before
    assert read_buffer(buffers.triangles.indices) == before


CAMERA = OmniCamera().with_quality("fast").resized(100)
CHANNELS = ("range", "instance", "normals", "albedo")
POSES = np.stack([pose((0.2 * n, 0.1, -0.2), yaw_deg=70.0 * n) for n in range(2)])


def _hits():
    """Ground truth of frames and batches, ranges, and the defines of the shader."""
    with Stage(mixed_scene(), dynamic_object()) as stage:
        with stage.open(CAMERA) as renderer:
            frame = renderer.render(POSES[0], also=CHANNELS)
            batch = renderer.render_batch(POSES, channels=CHANNELS)
        with stage.open(LaserScanner()) as laser:
            scans = [laser.scan(one).ranges_m for one in POSES]
            windows = laser._passes._caster._compiled_windows
    return [*(frame.channels[name] for name in CHANNELS), *batch.values(), *scans], windows


@pytest.mark.usefixtures("needs_opengl")
def test_windows_hit_the_same(monkeypatch):
    expected, none = _hits()
    assert none == ()
    size = 1 << 17  # a third of the vertices, half of the indices
    for module in (geometry_store, scene_buffers):
        monkeypatch.setattr(module, "window_bytes", lambda context: size)
    found, windows = _hits()
    assert windows == ("WINDOW_WORD_BITS 15",)
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one, other)
