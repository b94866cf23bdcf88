"""Estimate of GPU memory beside the buffers that are made."""

import dataclasses

import pytest

from omnisim.rendering.opengl.world.scene_buffers import SceneBuffers
from omnisim.rendering.opengl.world.vertex_records import gpu_bytes
from omnisim.scene import load_scene
from omnisim.scene.model import AlphaMode


def _with_glass(scene):
    """The scene with one material blended."""
    glass = dataclasses.replace(scene.materials[0], alpha_mode=AlphaMode.BLEND)
    return dataclasses.replace(scene, materials=(glass, *scene.materials[1:]))


def _without_normals(scene):
    meshes = tuple(dataclasses.replace(mesh, normals=None) for mesh in scene.meshes)
    return dataclasses.replace(scene, meshes=meshes)


@pytest.mark.parametrize(
    ("name", "changed"),
    [
        ("soccer", lambda scene: scene),
        ("courtyard", lambda scene: scene),
        ("courtyard", _with_glass),
        ("soccer", lambda scene: _with_glass(_without_normals(scene))),
    ],
)
def test_estimate_is_that_of_the_buffers(name, changed, context):
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
        for one in buffers.draw_items
        if one.texture_layer.array is not None
        for layer in one.texture_layer.array.layers
    }
    made += sum(4 * one.width * one.height * 4 / 3 for one in layers.values())
    # baked light gives some vertices copies; textures of the same pixels may have several layers
    assert gpu_bytes(scene) == pytest.approx(made, rel=0.2)
