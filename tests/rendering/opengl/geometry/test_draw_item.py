"""Draw items that show nothing to a viewpoint."""

import numpy as np
import pytest
import trimesh

from omnisim.core.poses import pose
from omnisim.rendering.opengl.geometry.scene_buffers import SceneBuffers
from omnisim.scene.model import Material, Mesh
from tests.scenes import scene_of


def _ball(material=0):
    ball = trimesh.creation.icosphere(subdivisions=1)
    return Mesh("ball", ball.vertices.astype(np.float32), ball.faces.astype(np.uint32), material)


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("double_sided", [False, True])
def test_a_closed_surface_shows_nothing_to_a_viewpoint_within_it(context, double_sided, mirrored):
    placed = pose((3.0, -2.0, 1.0), yaw_deg=40.0)
    placed[:3, :3] *= 0.5
    if mirrored:
        placed[:3, 1] *= -1.0
    scene = scene_of([_ball()], [Material(double_sided=double_sided)], [placed])
    buffers = SceneBuffers(context, scene)
    for viewpoint_m, is_within in (((3.2, -2.1, 1.1), True), ((4.0, -2.0, 1.0), False)):
        transforms = buffers.instance_transforms(np.array(viewpoint_m))
        shows = buffers.draw_items[0].shows(transforms.viewpoint_from_mesh[0])
        assert shows is (double_sided or not is_within)


def test_a_flat_instance_shows_itself(context):
    """Its transform cannot be inverted."""
    flat = np.diag((1.0, 1.0, 0.0, 1.0))
    buffers = SceneBuffers(context, scene_of([_ball()], [Material()], [flat]))
    transforms = buffers.instance_transforms(np.array((0.2, 0.0, 0.5)))
    assert buffers.draw_items[0].shows(transforms.viewpoint_from_mesh[0])
