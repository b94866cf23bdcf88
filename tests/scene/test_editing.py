"""Scenes from arrays, and edits of scenes: what changes, what is shared, what is refused."""

import numpy as np
import pytest

from omnisim.core.errors import SceneError
from omnisim.core.poses import pose
from omnisim.scene import Scene, load_scene
from omnisim.scene.model import AlphaMode
from tests.scene.world_corners import corners_of

TETRAHEDRON = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
FACES = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]
WHITE = np.full((2, 2, 3), 255, np.uint8)


def tetrahedron(name="part", **options):
    return Scene.from_arrays(name, TETRAHEDRON, FACES, **options)


def test_arrays_become_a_scene():
    uv, colors = np.zeros((4, 2)), np.array([[0.2, 0.4, 0.6]] * 4)
    scene = tetrahedron(normals=TETRAHEDRON, uv=uv, colors=colors, texture=WHITE)
    assert scene.instance_names == ("part",)
    np.testing.assert_allclose(corners_of(scene), np.array(TETRAHEDRON)[FACES], atol=1e-7)
    (mesh,), (material,) = scene.meshes, scene.materials
    np.testing.assert_array_equal(mesh.colors, np.float32([[0.2, 0.4, 0.6, 1.0]] * 4))
    assert material.base_color == (1.0, 1.0, 1.0, 1.0)
    assert material.alpha_mode is AlphaMode.OPAQUE
    assert material.texture.pixels.shape == (2, 2, 4)
    np.testing.assert_array_equal(scene.bounds_m(), [[0, 0, 0], [1, 1, 1]])
    (mesh,) = tetrahedron(colors=np.full((4, 4), 188, np.uint8)).meshes  # bytes are sRGB
    np.testing.assert_allclose(mesh.colors[0], [0.503, 0.503, 0.503, 188 / 255], atol=1e-3)
    (material,) = tetrahedron(base_color=(1, 0, 0, 0.5)).materials
    assert material.alpha_mode is AlphaMode.BLEND


def test_objects_are_added_moved_and_removed():
    part = tetrahedron()
    scene = part.added("second", part, pose((5, 0, 0))).added("third", part)
    assert scene.instance_names == ("part", "second", "third")
    assert len(scene.meshes) == 1  # shared
    moved = scene.moved("second", pose((0, 7, 0), yaw_deg=90.0))
    expected = np.array([[0, 7, 0], [0, 8, 0], [-1, 7, 0], [0, 7, 1]])
    np.testing.assert_allclose(corners_of(moved, "second"), expected[FACES], atol=1e-6)
    np.testing.assert_allclose(moved.pose_of("second"), pose((0, 7, 0), yaw_deg=90.0), atol=1e-12)
    assert moved.instances[0] is scene.instances[0]
    assert corners_of(scene, "second").min() == pytest.approx(0.0)  # as it was
    assert corners_of(scene, "second")[..., 0].min() == pytest.approx(5.0)
    rest = moved.removed("part").removed("second")
    assert rest.instance_names == ("third",)
    assert len(rest.meshes) == 1
    empty = rest.removed("third")
    assert (empty.meshes, empty.materials, empty.instances) == ((), (), ())


def test_only_the_named_object_gets_the_color():
    part = tetrahedron(colors=np.zeros((4, 3)))
    scene = part.added("second", part).recolored("second", (0.5, 0.25, 0.125))
    first, second = (scene.meshes[instance.mesh] for instance in scene.instances)
    assert scene.materials[second.material].base_color == (0.5, 0.25, 0.125, 1.0)
    assert second.colors is None
    assert first.colors is part.meshes[0].colors
    assert second.positions is first.positions
    again = scene.recolored("second", (1, 0, 0))
    assert (len(again.meshes), len(again.materials)) == (2, 2)  # the color before is gone


def test_a_loaded_object_turns_about_its_node_and_keeps_its_scale():
    scene = load_scene("courtyard")
    name = "crate_02"
    before, corners = scene.pose_of(name), corners_of(scene, name)
    turned = scene.moved(name, pose((1.0, 2.0, 3.0), yaw_deg=40.0))
    displacement = pose((1.0, 2.0, 3.0), yaw_deg=40.0) @ np.linalg.inv(before)
    expected = corners @ displacement[:3, :3].T + displacement[:3, 3]
    np.testing.assert_allclose(corners_of(turned, name), expected, atol=1e-6)
    back = turned.moved(name, before)
    np.testing.assert_allclose(corners_of(back, name), corners, atol=1e-6)


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda s: s.moved("prt", np.eye(4)), "instance 'prt': unknown; did you mean 'part'?"),
        (lambda s: s.removed(3), "instance 3: unknown; the scene has part"),
        (lambda s: s.moved("part", np.eye(3)), r"'part': pose: expected \(4, 4\), got \(3, 3\)"),
        (lambda s: s.moved("part", np.full((4, 4), np.nan)), "pose: expected finite numbers, got"),
        (lambda s: s.moved("part", 2 * np.eye(4)), "pose: expected a rotation and a translation"),
        (lambda s: s.moved("part", "here"), "instance 'part': pose: expected numbers, got 'here'"),
        (lambda s: s.added("part", s), "instance 'part': expected a new name"),
        (lambda s: s.added("", s), "instance: expected a name, got ''"),
        (lambda s: s.recolored("part", (255, 0, 0)), "base_color: expected three or four numbers"),
        (lambda s: s.recolored("part", texture=WHITE), "texture: expected texture coordinates"),
        (lambda s: s.bounds_m("other"), "instance 'other': unknown; the scene has part"),
    ],
)
def test_faulty_edits_are_refused(edit, message):
    with pytest.raises(SceneError, match=message):
        edit(tetrahedron())


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"vertices_m": [[0, 0]]}, r"vertices_m: expected \(n, 3\), got \(1, 2\)"),
        ({"vertices_m": [[0, 0, np.nan]] * 4}, "vertices_m: expected finite numbers, got NaN"),
        ({"triangles": [[0, 1, 9]]}, "expected vertices below 4, got 9"),
        ({"triangles": [[0, 1, -1]]}, "expected vertices below 4, got -1"),
        ({"triangles": [[0, 1, 1.5]]}, "triangles: expected whole numbers"),
        ({"triangles": np.zeros((0, 3))}, "triangles: expected whole numbers"),
        ({"normals": np.zeros((3, 3))}, r"normals: expected \(4, 3\), got \(3, 3\)"),
        ({"uv": np.zeros((4, 3))}, r"uv: expected \(4, 2\), got \(4, 3\)"),
        ({"colors": np.full((4, 3), 200.0)}, "colors: expected uint8, or numbers from 0 to 1"),
        ({"texture": WHITE}, "texture: expected uv with it, got none"),
        ({"texture": WHITE / 255.0, "uv": np.zeros((4, 2))}, "expected .* uint8, got .* float64"),
    ],
)
def test_faulty_arrays_are_refused(arrays, message):
    with pytest.raises(SceneError, match="'part'.*" + message):
        Scene.from_arrays("part", **({"vertices_m": TETRAHEDRON, "triangles": FACES} | arrays))
