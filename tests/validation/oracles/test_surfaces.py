import dataclasses

import numpy as np
import pytest

from omnisim.core.errors import SceneError
from omnisim.scene.model import AlphaMode, Material, Mesh
from omnisim.validation.oracles.surfaces import opaque_only, visible_surfaces
from tests.scenes import scene_of

REACH_M = 0.01
TRIANGLES = np.array([[0, 1, 2]], dtype=np.uint32)


def _floor(material=0):
    """A triangle in z = 0 whose front looks up."""
    corners = np.array([(-1, -1, 0), (1, -1, 0), (0, 1, 0)], dtype=np.float32)
    return Mesh("floor", corners, TRIANGLES, material)


def _heights(scene, height_m):
    """Heights of the viewpoint above each visible triangle, on its visible side."""
    surfaces = visible_surfaces(scene, np.array([0.0, 0.0, height_m]), REACH_M)
    corners = [triangle for surface in surfaces for triangle in surface.triangles_m]
    normals = [np.cross(b - a, c - a) for a, b, c in corners]
    return [
        -a @ normal / np.linalg.norm(normal)
        for (a, _, _), normal in zip(corners, normals, strict=True)
    ]


@pytest.mark.parametrize(
    ("material", "poses", "height_m", "seen"),
    [
        (Material(), None, 0.5, [0.5]),
        (Material(), None, -0.5, []),
        # some of the mirror may still be on the front's side
        (Material(), None, -0.5 * REACH_M, [-0.5 * REACH_M]),
        (Material(double_sided=True), None, 0.5, [0.5]),
        (Material(double_sided=True), None, -0.5, [0.5]),
        # upside down by a reflection: what looked up looks down
        (Material(), [np.diag([1.0, 1.0, -1.0, 1.0])], 0.5, []),
        (Material(), [np.diag([1.0, 1.0, -1.0, 1.0])], -0.5, [0.5]),
    ],
)
def test_the_side_that_is_seen_is_shown_and_backs_are_left_out(material, poses, height_m, seen):
    scene = scene_of([_floor()], [material], *([] if poses is None else [poses]))
    np.testing.assert_allclose(_heights(scene, height_m), seen)


def test_corners_keep_their_colors_and_coordinates_when_turned():
    mesh = dataclasses.replace(
        _floor(), colors=np.concatenate((np.eye(3), np.ones((3, 1))), axis=1).astype(np.float32)
    )
    scene = scene_of([mesh], [Material(double_sided=True)])
    (surface,) = visible_surfaces(scene, np.array([0.0, 0.0, -1.0]), REACH_M)
    for corner, color in zip(surface.triangles_m[0], surface.colors[0], strict=True):
        which = int(np.argmax(color))
        assert np.allclose(corner, mesh.positions[which] + np.array([0.0, 0.0, 1.0]))


def test_far_from_the_origin_nothing_is_lost():
    pose = np.eye(4)
    pose[:3, 3] = (4e5, -3e6, 100.0)
    scene = scene_of([_floor()], [Material()], [pose])
    (surface,) = visible_surfaces(scene, pose[:3, 3] + (0.0, 0.0, 1.0), REACH_M)
    assert np.array_equal(surface.triangles_m[0], _floor().positions - np.array([0.0, 0.0, 1.0]))


def test_one_surface_for_each_look():
    meshes = [_floor(0), _floor(1), _floor(0)]
    surfaces = visible_surfaces(
        scene_of(meshes, [Material("a"), Material("b")]), np.array([0.0, 0.0, 1.0]), REACH_M
    )
    assert {(s.material.name, len(s.triangles_m)) for s in surfaces} == {("a", 2), ("b", 1)}


def test_only_opaque_surfaces_are_left():
    materials = [Material("leaf", alpha_mode=AlphaMode.MASK), Material("wall")]
    scene = scene_of([_floor(0), _floor(1)], materials)
    with pytest.raises(SceneError, match="'leaf' is not opaque"):
        visible_surfaces(scene, np.array([0.0, 0.0, 1.0]), REACH_M)
    left = opaque_only(scene)
    assert [mesh.material for mesh in left.meshes] == [1]
    assert [(instance.name, instance.mesh) for instance in left.instances] == [("object 1", 0)]
    with pytest.raises(SceneError, match="no opaque surface"):
        opaque_only(scene_of([_floor(0)], materials))
