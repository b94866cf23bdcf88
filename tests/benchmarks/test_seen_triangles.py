"""Triangles that an image shows: walls before walls, and walls seen from behind."""

import dataclasses

import numpy as np
import pytest

from benchmarks.seen_triangles import count_seen_triangles
from omnisim import OmniCamera
from omnisim.core.poses import pose
from omnisim.scene.model import AlphaMode, Material, Mesh
from tests.scenes import scene_of

CAMERA = OmniCamera(polygons=None).resized(64)


def wall(distance_m, half_m, material=0, flipped=False):
    """Two triangles ahead of the origin that turn their front to it, or their back."""
    corners = [(distance_m, y, z) for y, z in ((half_m, -half_m), (-half_m, -half_m))]
    corners += [(distance_m, y, z) for y, z in ((-half_m, half_m), (half_m, half_m))]
    corners = np.array(corners, dtype=np.float32) - (0.0, 0.0, 0.3)  # below the mirror's rim
    triangles = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint32)
    # seen from the origin, y to the left and z up: right, up, left is counter-clockwise
    return Mesh(
        "wall", corners.astype(np.float32), triangles[:, ::-1] if flipped else triangles, material
    )


def seen(context, *meshes, materials=None, poses=None, yaw_deg=0.0):
    scene = scene_of(meshes, materials or [Material()], poses)
    at = pose(yaw_deg=yaw_deg)
    return count_seen_triangles(context, scene, CAMERA.model, at, 64, CAMERA.near_m)


def test_triangles_behind_a_wall_are_not_counted(context):
    assert seen(context, wall(2.0, 0.5)) == 2
    assert seen(context, wall(2.0, 0.5), wall(3.0, 0.5)) == 2
    assert seen(context, wall(2.0, 0.5), wall(3.0, 2.0)) == 4
    assert seen(context, wall(3.0, 0.5), wall(2.0, 0.5)) == 2


@pytest.mark.parametrize("yaw_deg", [0.0, 90.0, 180.0, -90.0])
def test_it_is_seen_wherever_the_camera_looks(context, yaw_deg):
    assert seen(context, wall(2.0, 0.5), yaw_deg=yaw_deg) == 2


def test_once_for_each_face_of_the_cube(context):
    # half to the left of the edge between two faces, half to its right
    assert seen(context, wall(2.0, 0.5), yaw_deg=45.0) == 4


def test_only_fronts_are_seen_unless_both_sides_are_painted(context):
    assert seen(context, wall(2.0, 0.5, flipped=True)) == 0
    both = dataclasses.replace(Material(), double_sided=True)
    assert seen(context, wall(2.0, 0.5, flipped=True), materials=[both]) == 2
    mirrored = np.diag([1.0, -1.0, 1.0, 1.0])  # turns as its triangles do, so it is a front still
    assert seen(context, wall(2.0, 0.5), poses=[mirrored]) == 2


def test_glass_hides_nothing_and_the_sky_is_not_in_the_image(context):
    glass = Material(alpha_mode=AlphaMode.BLEND)
    assert seen(context, wall(2.0, 0.5, 1), wall(3.0, 0.5), materials=[Material(), glass]) == 2
    above = pose((0.0, 0.0, 9.0))
    assert seen(context, wall(2.0, 0.5), poses=[above]) == 0
