"""By what the instances of a scene reflect it."""

import dataclasses

import pytest

from omnisim.core.poses import pose
from omnisim.rendering.reflection_kinds import reflection_kinds
from omnisim.scene.model import Lighting, Material
from omnisim.validation.material_chart import sphere
from tests.scenes import scene_of, square

MIRROR = Material(metallic=1.0, roughness=0.0)
PANE = Material(transmission=1.0, roughness=0.0, specular=1.0)
MATTE = Material(roughness=1.0)
LIGHTING = Lighting((1.0, 1.0, 1.0), ())


def kinds_of(meshes, materials, lighting=LIGHTING, **options):
    """Kinds of reflections of each mesh, 4 m apart, of the material with its number."""
    meshes = [dataclasses.replace(mesh, material=at) for at, mesh in enumerate(meshes)]
    places = [pose((4.0 * at, 0.0, 0.0)) for at in range(len(meshes))]
    scene = scene_of(meshes, materials, places, lighting)
    kinds = reflection_kinds(scene, **options)
    return [kinds.get(instance.name) for instance in scene.instances]


def test_planes_are_mirrors_or_panes_and_bodies_have_probes():
    meshes = [square(), square(), sphere(1.0, 8), square()]
    found = kinds_of(meshes, [MIRROR, PANE, MIRROR, MATTE])
    assert found == [("mirror",), ("pane",), ("probe",), None]


def test_bodies_without_a_probe_reflect_the_sky():
    balls = [sphere(1.0, 8), sphere(0.5, 8)]
    assert kinds_of(balls, [MIRROR, MIRROR], probes=1) == [("probe",), ("sky",)]


def test_parts_of_an_instance_have_their_own():
    scene = scene_of(
        [square(), dataclasses.replace(sphere(0.5, 8), material=1)],
        [MIRROR, MIRROR],
        [pose((0.0, 0.0, 0.0)), pose((4.0, 0.0, 0.0))],
        LIGHTING,
    )
    instances = tuple(dataclasses.replace(instance, name="trolley") for instance in scene.instances)
    kinds = reflection_kinds(dataclasses.replace(scene, instances=instances))
    assert kinds == {"trolley": ("mirror", "probe")}


@pytest.mark.parametrize("is_matte", [False, True])
def test_nothing_reflects_in_matte_light(is_matte):
    lighting = dataclasses.replace(LIGHTING, is_matte=is_matte)
    assert kinds_of([sphere(1.0, 8)], [MIRROR], lighting) == [None if is_matte else ("probe",)]
