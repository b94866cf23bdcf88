"""Draw items that show nothing to a viewpoint."""

import numpy as np
import pytest
import trimesh

from omnisim.core.poses import pose
from omnisim.rendering.contract import ScenePoses
from omnisim.rendering.opengl.world.scene_buffers import SceneBuffers
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
        shows = buffers.draw_items[0].shows(np.array(viewpoint_m))
        assert shows is (double_sided or not is_within)


def test_a_flat_instance_shows_itself(context):
    """Its transform cannot be inverted."""
    flat = np.diag((1.0, 1.0, 0.0, 1.0))
    buffers = SceneBuffers(context, scene_of([_ball()], [Material()], [flat]))
    assert buffers.draw_items[0].shows(np.array((0.2, 0.0, 0.5)))


def test_items_of_objects_show_themselves_by_the_pose_of_their_object(context):
    """A viewpoint within one of two balls, where the other is seen from outside."""
    buffers = SceneBuffers(context, scene_of([]), [scene_of([_ball()], [Material()])] * 2)
    poses = [pose((5.0, 0.0, 1e5), yaw_deg=20.0), pose((9.0, 0.0, 1e5), pitch_deg=70.0)]
    for number, viewpoint_m in enumerate([(5.2, 0.1, 1e5), (9.0, -0.2, 1e5 + 0.3)]):
        shown = buffers.showing(np.arange(2), ScenePoses(pose(viewpoint_m), poses))
        objects = [buffers.draw_items[index].object_index for index in shown]
        assert objects == [1 - number]
