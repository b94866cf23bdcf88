"""Transforms of a scene's items and dynamic objects, against one scene of all."""

import numpy as np

from omnisim.core.poses import pose
from omnisim.rendering.opengl.gl.buffers import read_buffer
from omnisim.rendering.opengl.world.scene_buffers import SceneBuffers
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
    assert {
        draw.name for draw, kept in zip(buffers.draw_items, shown, strict=True) if not kept
    } == {
        "hull",
        "tube",
    }
