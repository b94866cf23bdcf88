"""Buffers of a scene's meshes, uploaded on demand, beside the arrays of its meshes."""

import numpy as np
import pytest

from omnisim.cameras import EquidistantCamera
from omnisim.core.poses import pose
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.opengl.gl.buffers import read_buffer
from omnisim.rendering.opengl.world import geometry_store
from omnisim.rendering.opengl.world.scene_buffers import SceneBuffers
from omnisim.rendering.opengl.world.vertex_records import VERTEX
from omnisim.rendering.stage import open_sensor
from omnisim.scene import Scene
from tests.vehicles import surroundings


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
