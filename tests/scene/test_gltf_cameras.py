"""Cameras of glTF files are viewpoints with the attitude that the file states."""

import numpy as np
import pytest

from omnisim.apps.cli.images.image_requests import RenderRequest
from omnisim.apps.cli.inputs import Viewpoint
from omnisim.core.errors import OutputError
from omnisim.core.poses import rotation_from_roll_pitch_yaw
from omnisim.scene import load_scene
from tests.scene.gltf_builder import GltfBuilder

HALF = np.sqrt(0.5)


@pytest.fixture
def scene(tmp_path):
    gltf = GltfBuilder()
    gltf.node(mesh=gltf.triangle())
    gltf.tree["cameras"] = [{"name": "lens", "type": "perspective", "perspective": {"yfov": 1.0}}]
    gltf.node(name="level", camera=0, translation=[1, 2, 3], scale=[2, 2, 2])
    gltf.node(camera=0, rotation=[0, HALF, 0, HALF])  # 90° to the left, about the file's y
    gltf.node(name="flat", camera=0, scale=[1, 0, 1])
    gltf.node(name="far", camera=0, translation=[9e14, 0, 0], scale=[9e14, 9e14, 9e14])
    gltf.node(name="beyond", camera=0, matrix=[9e14] * 16)
    gltf.node(camera=0, rotation=[-HALF, 0, 0, HALF])  # down
    return load_scene(gltf.write(tmp_path / "a.glb"))


def test_cameras_have_the_poses_of_their_nodes(scene):
    """The file's −z is the world's +y."""
    level, left, _, down = scene.cameras  # without flat ones
    assert (level.name, left.name, down.name) == ("level", "lens", "lens_1")
    assert level.position_m == (1.0, -3.0, 2.0)
    assert (level.yaw_deg, level.pitch_deg, level.roll_deg) == (90.0, 0.0, 0.0)
    assert (abs(left.yaw_deg), left.pitch_deg, left.roll_deg) == (180.0, 0.0, 0.0)
    angles = np.radians((down.roll_deg, down.pitch_deg, down.yaw_deg))
    rotation = rotation_from_roll_pitch_yaw(*angles)
    np.testing.assert_allclose(rotation[:, 0], (0, 0, -1), atol=1e-7)  # x ahead
    np.testing.assert_allclose(rotation[:, 2], (0, 1, 0), atol=1e-7)  # the top of its image


def _request(scene, **options):
    return RenderRequest(scene=scene.name, output="o.png", **options)


def test_a_viewpoint_is_that_of_a_camera(scene):
    viewpoint = Viewpoint.in_scene(scene, _request(scene, at_camera="lens"))
    assert (viewpoint.position_m, abs(viewpoint.yaw_deg)) == ((0.0, 0.0, 0.0), 180.0)
    with pytest.raises(OutputError, match="--at-camera 'lend': did you mean 'lens'"):
        Viewpoint.in_scene(scene, _request(scene, at_camera="lend"))
    with pytest.raises(OutputError, match="--yaw: --at-camera has a pose of its own"):
        Viewpoint.in_scene(scene, _request(scene, at_camera="lens", yaw_deg=3.0))
    with pytest.raises(OutputError, match="--at-camera 'a': the scene's file has no cameras"):
        Viewpoint.in_scene(load_scene("soccer"), _request(scene, at_camera="a"))
