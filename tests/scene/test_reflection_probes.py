"""Places of reflection probes, and the surfaces that share them."""

import dataclasses

import numpy as np
import pytest
import trimesh

from omnisim.core.poses import pose
from omnisim.scene.model import Material, Mesh
from omnisim.scene.motion.deformation import Sphere
from omnisim.scene.planar_mirrors import SceneSurface, find_mirrors, scene_surfaces
from omnisim.scene.reflection_probes import find_probes
from omnisim.scene.surface_kind import SurfaceKind, kind_of
from omnisim.validation.material_chart import sphere
from tests.scenes import room, scene_of, square

CHROME = Material("chrome", metallic=1.0, roughness=0.0)
SATIN = Material("satin", metallic=1.0, roughness=0.4)
PLAIN = Material("plain")


def _probes(meshes, materials, poses=None):
    surfaces = scene_surfaces(scene_of(meshes, materials, poses), ())
    return find_probes(surfaces, find_mirrors(surfaces, SurfaceKind.PLANAR_MIRROR))


def test_a_ball_is_left_out_of_its_own_probe_at_its_center():
    place = pose((1.0, 2.0, 3.0)) @ np.diag((1.0, -2.0, 1.0, 1.0))  # flips the winding
    (probe,) = _probes([sphere(0.5, 16), room()], [CHROME, PLAIN], [place, np.eye(4)])
    np.testing.assert_allclose(probe.center_m, (1.0, 2.0, 3.0), atol=1e-6)
    assert probe.surfaces == probe.left_out == {0}
    assert probe.radius_m == pytest.approx(0.5 * np.sqrt(6.0), rel=1e-3)


def test_rooms_show_themselves_and_sheets_have_probes_in_front_of_them():
    inward = dataclasses.replace(sphere(4.0, 16), triangles=sphere(4.0, 16).triangles[:, ::-1])
    (probe,) = _probes([inward], [SATIN])
    assert not probe.left_out
    wall = square(2.0)  # in the plane z = 0, toward +z
    tilted = pose((0.0, 0.0, 5.0), roll_deg=90.0)
    (probe,) = _probes([wall], [SATIN], [tilted])
    np.testing.assert_allclose(probe.center_m, (0.0, -0.25 * 2.0 * np.sqrt(2.0), 5.0), atol=1e-6)
    assert probe.left_out == {0}


def test_planar_mirrors_and_matte_surfaces_have_no_probe():
    assert _probes([square()], [CHROME]) == ()
    assert _probes([sphere(1.0, 8)], [PLAIN]) == ()
    assert _probes([sphere(1.0, 8)], [dataclasses.replace(SATIN, roughness=0.6)]) == ()


def test_parts_within_a_body_share_its_probe_and_are_not_in_it():
    """A seat and a chrome handle within a car; a lamp above it, and a larger tree around it."""
    meshes = [
        sphere(1.0, 8),
        dataclasses.replace(sphere(0.2, 8), material=1),
        sphere(0.1, 8),
        dataclasses.replace(sphere(0.2, 8), material=1),
        dataclasses.replace(sphere(2.0, 8), material=1),
    ]
    places = [pose((0, 0, z)) for z in (0.0, 0.3, 0.5, 1.5, 0.0)]
    (probe,) = _probes(meshes, [CHROME, PLAIN], places)
    assert probe.surfaces == {0, 2}
    assert probe.left_out == {0, 1, 2}


def test_parts_within_a_building_have_their_own_probes():
    largest, smaller = _probes([sphere(9.0, 8), sphere(0.5, 8)], [CHROME])
    assert largest.surfaces == largest.left_out == {0}
    assert smaller.surfaces == {1}


def test_smooth_metal_precedes_larger_rough_gloss():
    gloss = Material(metallic=0.0, roughness=0.4, specular=1.0)
    meshes = [sphere(2.0, 8), dataclasses.replace(sphere(0.5, 8), material=1)]
    places = [pose(), pose((9.0, 0.0, 0.0))]
    assert [probe.surfaces for probe in _probes(meshes, [gloss, CHROME], places)] == [{1}, {0}]
    coated = dataclasses.replace(gloss, clearcoat=1.0)
    assert [probe.surfaces for probe in _probes(meshes, [coated, gloss], places)] == [{0}, {1}]
    column = dataclasses.replace(sphere(1.0, 8), name="column")  # of less area than a ball
    places = [np.diag((0.05, 0.05, 2.0, 1.0)), pose((9.0, 0.0, 0.0))]
    ball = sphere(0.5, 8)
    assert [probe.surfaces for probe in _probes([column, ball], [CHROME], places)] == [{1}, {0}]


def test_objects_do_not_share_probes():
    ball = sphere(1.0, 8)
    surfaces = {
        number: SceneSurface(ball, CHROME, kind_of(CHROME), np.diag((size, size, size, 1.0)), index)
        for number, (size, index) in enumerate([(1.0, None), (0.5, 0), (0.2, 0)])
    }
    first, second = find_probes(surfaces, ())
    assert (first.object_index, first.surfaces) == (None, {0})
    assert (second.object_index, second.surfaces) == (0, {1, 2})
    assert [probe.surfaces for probe in find_probes(surfaces, (), {2})] == [{2}]


def test_slim_pipes_are_left_out_of_their_probes():
    pipe = trimesh.creation.annulus(0.03, 0.04, 2.0)
    mesh = Mesh("pipe", pipe.vertices.astype(np.float32), pipe.faces.astype(np.uint32), 0)
    (probe,) = _probes([mesh], [SATIN])
    assert probe.left_out == {0}


def test_probes_follow_deforming_surfaces():
    class Growing:
        def sphere_at(self, time_s):
            return Sphere(np.array((time_s, 0.0, 0.0)), 1.0)

    mesh = dataclasses.replace(sphere(1.0, 8), deformation=Growing())
    (probe,) = _probes([mesh, sphere(0.1, 8)], [CHROME])[:1]
    assert probe.deforming == 0
    assert probe.surfaces == {0}
