"""Planes of planar mirrors: of boxes, sheets and curved meshes."""

import dataclasses

import numpy as np
import pytest

from omnisim.core.poses import pose
from omnisim.scene.model import Material
from omnisim.scene.planar_mirrors import MAX_PLANES, SceneSurface, find_mirrors, flat_parts
from omnisim.scene.surface_kind import SurfaceKind, kind_of
from omnisim.validation.material_chart import sphere
from tests.rendering.opengl.sheets import sheet
from tests.scenes import square
from tests.vehicles import box

CHROME = Material(metallic=1.0, roughness=0.0)


def _surface(mesh, place=None, object_index=None, material=CHROME):
    place = np.eye(4) if place is None else place
    return SceneSurface(mesh, material, kind_of(material), place, object_index)


def test_planes_of_a_box():
    """Far from the origin, turned and scaled."""
    place = pose((400.0, -300.0, 20.0), roll_deg=10.0, pitch_deg=20.0, yaw_deg=30.0) @ np.diag(
        (0.5, 2.0, 1.5, 1.0)
    )
    planes = find_mirrors({7: _surface(box("box", 0), place)}, SurfaceKind.PLANAR_MIRROR)
    assert len(planes) == 6
    np.testing.assert_allclose([plane.area_m2 for plane in planes], [3, 3, 1, 1, 0.75, 0.75])
    for plane in planes:
        assert list(plane.parts) == [7]
        corners = box("box", 0).positions[box("box", 0).triangles[plane.parts[7]]].reshape(-1, 3)
        corners = corners @ place[:3, :3].T + place[:3, 3]
        np.testing.assert_allclose(corners @ plane.normal, plane.offset_m, atol=1e-5)


def test_curved_and_bumpy_meshes_have_none():
    ball = sphere(0.7, 200)
    flat_shaded = dataclasses.replace(ball, normals=None)
    for mesh in (ball, flat_shaded, sheet("bumpy", 0)):
        assert not flat_parts(mesh)


def test_the_planes_of_many_boxes_are_limited():
    places = [pose((1.5 * (n % 20), 1.5 * (n // 20), 0.0)) for n in range(400)]
    block = box("box", 0)
    surfaces = {n: _surface(block, place) for n, place in enumerate(places)}
    planes = find_mirrors(surfaces, SurfaceKind.PLANAR_MIRROR)
    assert len(planes) == MAX_PLANES
    np.testing.assert_allclose([plane.area_m2 for plane in planes[:3]], (400.0, 400.0, 20.0))
    assert all(plane.sides == {1} for plane in planes)


@pytest.mark.parametrize("flip", [1.0, -1.0])
def test_sides_of_mirrored_surfaces(flip):
    """The front of a mirrored square is still up."""
    (plane,) = find_mirrors(
        {0: _surface(square(), pose() @ np.diag((flip, 1.0, 1.0, 1.0)))}, SurfaceKind.PLANAR_MIRROR
    )
    assert plane.sides == {round(plane.normal[2])}


def test_coplanar_surfaces_share_a_plane_unless_they_move():
    left, right = pose((-3.0, 0.0, 1.0)), pose((3.0, 0.0, 1.0), roll_deg=180.0)
    fine = sheet("fine", 0, side=40, bumps_m=0.0)
    surfaces = {
        0: _surface(fine, left), 1: _surface(square(1.0), right),
        2: _surface(square(1.0), left, object_index=0),
        3: _surface(square(1.0), pose((0.0, 0.0, 1.01))),
    }  # fmt: skip
    planes = find_mirrors(surfaces, SurfaceKind.PLANAR_MIRROR)
    assert sorted(sorted(plane.parts) for plane in planes) == [[0, 1], [2], [3]]
    shared = next(plane for plane in planes if len(plane.parts) == 2)
    assert shared.parts[0].all()
    assert shared.area_m2 == pytest.approx(5.0)
    assert abs(shared.offset_m) == pytest.approx(1.0)


def test_the_largest_planes_come_first():
    surfaces = {
        number: _surface(square(0.1 * (1 + number)), pose((0.0, 0.0, number)))
        for number in range(4)
    }
    planes = find_mirrors(surfaces, SurfaceKind.PLANAR_MIRROR)
    assert [list(plane.parts) for plane in planes] == [[3], [2], [1], [0]]
