"""Scenes from trimesh's objects in memory, against the same ones through a GLB file."""

import numpy as np
import pytest
import trimesh
from PIL import Image
from trimesh.visual.material import PBRMaterial, SimpleMaterial

from omnisim.core.errors import SceneError
from omnisim.scene import Scene, load_scene
from omnisim.scene.model import AlphaMode
from tests.scene.world_corners import corners_of

PIXELS = np.arange(48, dtype=np.uint8).reshape(4, 4, 3)


def textured_box(material):
    box = trimesh.creation.box((1.0, 2.0, 3.0))
    uv = np.linspace(0.0, 1.0, 2 * len(box.vertices)).reshape(-1, 2)
    box.visual = trimesh.visual.TextureVisuals(uv, material)
    return box


def test_a_scene_is_that_of_its_glb_file(tmp_path):
    source = trimesh.Scene()
    material = PBRMaterial(
        baseColorTexture=Image.fromarray(PIXELS),
        baseColorFactor=[128, 64, 255, 255],
        alphaMode="MASK",
        alphaCutoff=0.25,
        doubleSided=True,
    )
    source.add_geometry(textured_box(material), node_name="box", geom_name="box")
    turned = trimesh.transformations.rotation_matrix(0.7, (1, 2, 3), (0.5, 0, 0))
    turned[:3, 3] += (4.0, 5.0, 6.0)
    source.graph.update(frame_to="twin", matrix=turned, geometry="box")
    source.export(tmp_path / "scene.glb")
    expected = load_scene(tmp_path / "scene.glb")
    scene = Scene.from_trimesh(source, "boxes", up_axis="y")
    assert set(scene.instance_names) == {"box", "twin"} == set(expected.instance_names)
    assert len(scene.meshes) == 1
    for name in scene.instance_names:
        np.testing.assert_allclose(corners_of(scene, name), corners_of(expected, name), atol=1e-6)
        np.testing.assert_allclose(scene.pose_of(name), expected.pose_of(name), atol=1e-6)
    ours, theirs = scene.materials[0], expected.materials[0]
    np.testing.assert_allclose(ours.base_color, theirs.base_color, atol=1e-6)
    assert (ours.alpha_mode, ours.alpha_cutoff) == (AlphaMode.MASK, 0.25)
    assert ours.double_sided
    np.testing.assert_array_equal(ours.texture.pixels, theirs.texture.pixels)
    np.testing.assert_allclose(
        scene.meshes[0].texture_coordinates, expected.meshes[0].texture_coordinates, atol=1e-6
    )


def test_a_mesh_alone_has_the_name_and_unit_it_is_given():
    box = trimesh.creation.box((10.0, 20.0, 30.0))
    box.units = "centimeters"
    scene = Scene.from_trimesh(box, "parcel")
    assert scene.instance_names == ("parcel",)
    np.testing.assert_allclose(np.ptp(scene.bounds_m(), axis=0), (0.1, 0.2, 0.3), atol=1e-7)
    scene = Scene.from_trimesh(box, meters_per_unit=1.0, up_axis="y")
    np.testing.assert_allclose(np.ptp(scene.bounds_m(), axis=0), (10.0, 30.0, 20.0), atol=1e-5)


def test_colors_are_srgb():
    box = trimesh.creation.box()
    box.visual.vertex_colors = np.full((8, 4), (188, 0, 255, 255), np.uint8)
    (mesh,) = Scene.from_trimesh(box).meshes
    np.testing.assert_allclose(mesh.colors[0], (0.503, 0.0, 1.0, 1.0), atol=1e-3)
    simple = textured_box(SimpleMaterial(diffuse=[188, 0, 255, 255]))
    (material,) = Scene.from_trimesh(simple).materials
    np.testing.assert_allclose(material.base_color, (0.503, 0.0, 1.0, 1.0), atol=1e-3)
    image = SimpleMaterial(image=Image.fromarray(PIXELS))
    (material,) = Scene.from_trimesh(textured_box(image)).materials
    np.testing.assert_array_equal(material.texture.pixels[..., :3], PIXELS)
    assert material.base_color == (1.0, 1.0, 1.0, 1.0)


def test_normals_are_those_asked_for_and_points_are_noticed():
    ball = trimesh.creation.icosphere(1)
    assert Scene.from_trimesh(ball).meshes[0].normals is None
    assert Scene.from_trimesh(ball, smooth=True).meshes[0].normals is not None
    assert Scene.from_trimesh(ball, smooth=False).meshes[0].normals is None
    points = trimesh.Scene([ball, trimesh.PointCloud(np.zeros((3, 3)))])
    assert Scene.from_trimesh(points, "mixed").notices == ("mixed: points and lines are not drawn",)


@pytest.mark.parametrize(
    ("source", "options", "message"),
    [
        ("box.glb", {}, "expected a trimesh.Scene or trimesh.Trimesh, got str"),
        (trimesh.Scene(), {}, "has no triangles to draw"),
        (trimesh.creation.box(), {"up_axis": "up"}, "up axis: expected x, y or z, got 'up'"),
        (trimesh.creation.box(), {"meters_per_unit": 0.0}, "meters_per_unit: expected a number"),
        (trimesh.PointCloud(np.zeros((3, 3))), {}, "expected a trimesh.Scene"),
    ],
)
def test_anything_else_is_refused(source, options, message):
    with pytest.raises(SceneError, match=message):
        Scene.from_trimesh(source, **options)
