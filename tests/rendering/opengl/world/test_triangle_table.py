"""The scene's triangles as a lookup finds them."""

import numpy as np

from omnisim.rendering.opengl.gl.buffers import read_buffer
from omnisim.rendering.opengl.world.geometry_store import NO_NEIGHBOR, neighbors
from omnisim.rendering.opengl.world.scene_buffers import SceneBuffers
from omnisim.scene.model import AlphaMode, Material
from tests.rendering.opengl.sheets import sheet
from tests.scenes import scene_of
from tests.vehicles import box

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
