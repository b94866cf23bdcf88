"""Items of a scene and of dynamic objects: where they are, what they show, and their memory."""

import dataclasses

import numpy as np
import pytest
import trimesh

from omnisim.core.poses import pose
from omnisim.rendering.contract import ScenePoses
from omnisim.rendering.opengl.gl.buffers import read_buffer
from omnisim.rendering.opengl.world.scene_buffers import SceneBuffers
from omnisim.rendering.opengl.world.vertex_records import gpu_bytes
from omnisim.scene import load_scene
from omnisim.scene.model import AlphaMode, Material, Mesh
from tests.scenes import scene_of
from tests.vehicles import body, merged, surroundings

VIEWPOINT_M = np.array([0.3, -2.0, 1.0])


def test_dynamic_objects_are_placed_as_if_they_stood_there(context):
    scene, objects = surroundings(), (body(), body())
    poses = (
        pose((1.0, 2.0, 0.5), roll_deg=10.0, pitch_deg=20.0, yaw_deg=30.0),
        pose((-1.0, 0.0, 0.0), yaw_deg=200.0),
    )
    still = merged(merged(scene, objects[0], poses[0]), objects[1], poses[1])
    buffers, expected = SceneBuffers(context, scene, objects), SceneBuffers(context, still)
    assert [draw.name for draw in buffers.draw_items] == [draw.name for draw in expected.draw_items]
    assert [draw.flips_winding for draw in buffers.draw_items] == [
        draw.flips_winding for draw in expected.draw_items
    ]
    np.testing.assert_allclose(buffers.radii_m, expected.radii_m, rtol=1e-12)
    assert read_buffer(buffers.vertices) == read_buffer(expected.vertices)
    assert read_buffer(buffers.indices) == read_buffer(expected.indices)
    elsewhere = pose((9.0, 0.0, 0.0)), poses[1]
    for others in (poses, poses, elsewhere):  # whatever was asked for before
        buffers.instance_transforms(np.zeros(3), others)
        placement = buffers.instance_transforms(VIEWPOINT_M, poses)
        for ours, theirs in zip(placement, expected.instance_transforms(VIEWPOINT_M), strict=True):
            np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=1e-14)


def test_instances_of_dynamic_objects_are_hidden_by_name(context):
    buffers = SceneBuffers(context, surroundings(), (body(),))
    assert buffers.shown().all()
    shown = buffers.shown({(0, "hull"), (0, "tube"), (1, "cage"), (None, "box")})
    names = [buffers.draw_items[index].name for index in np.flatnonzero(~shown)]
    assert sorted(names) == ["hull", "tube"]


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


def _with_glass(scene):
    """The scene with one material blended, and without normals."""
    glass = dataclasses.replace(scene.materials[0], alpha_mode=AlphaMode.BLEND)
    meshes = tuple(dataclasses.replace(mesh, normals=None) for mesh in scene.meshes)
    return dataclasses.replace(scene, materials=(glass, *scene.materials[1:]), meshes=meshes)


@pytest.mark.parametrize(
    ("name", "changed"), [("courtyard", lambda scene: scene), ("soccer", _with_glass)]
)
def test_the_estimate_of_gpu_memory_is_that_of_the_buffers(name, changed, context):
    scene = changed(load_scene(name))
    buffers = SceneBuffers(context, scene)
    geometry = buffers.clustered_geometry
    made = geometry.vertices.size + geometry.indices.size
    made += 16 * geometry.triangle_count  # corners
    if geometry.normals is not None:
        made += geometry.normals.size
    if buffers.shown_one_by_one().any():
        made += buffers.vertices.size + buffers.indices.size
    layers = {
        layer.glo: layer
        for item in buffers.draw_items
        if item.texture_layer.array is not None
        for layer in item.texture_layer.array.layers
    }
    made += sum(4 * one.width * one.height * 4 / 3 for one in layers.values())
    # baked light gives some vertices copies; textures of the same pixels may have several layers
    assert gpu_bytes(scene) == pytest.approx(made, rel=0.2)
