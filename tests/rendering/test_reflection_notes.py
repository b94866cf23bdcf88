"""Materials whose reflections of the scene the back end of cubes leaves out."""

import dataclasses

import numpy as np
import pytest

from omnisim.core.poses import pose
from omnisim.rendering.reflection_kinds import frosted_notes, reflection_notes
from omnisim.scene.model import DynamicObject, Lighting, Material, Texture
from omnisim.scene.motion.object_motion import Rest
from omnisim.scene.surface_kind import SurfaceKind, kind_of
from omnisim.validation.material_chart import sphere
from tests.scenes import scene_of, square
from tests.vehicles import box

MATTE = Lighting((1.0, 1.0, 1.0), (), is_matte=True)


def _map(green):
    pixels = np.full((2, 2, 4), 255, dtype=np.uint8)
    pixels[0, 0, 1] = green
    return Texture(pixels)


@pytest.mark.parametrize(
    ("material", "expected"),
    [
        (Material(), False),
        (Material(metallic=1.0, roughness=0.1), True),
        (Material(metallic=1.0, roughness=0.1, unlit=True), False),
        (Material(metallic=1.0, roughness=0.8), False),
        (Material(specular=1.0, roughness=0.5), True),
        (Material(clearcoat=0.5), True),
        (Material(emissive=(1.0, 1.0, 1.0), roughness=0.1), False),
        (Material(metallic=1.0, metallic_roughness_map=_map(100)), True),
        (Material(metallic=1.0, metallic_roughness_map=_map(200)), False),
    ],
)
def test_smooth_metal_gloss_and_coats_reflect_the_scene(material, expected):
    assert bool(kind_of(material) & SurfaceKind.REFLECTING) is expected
    scene = scene_of([sphere(1.0, 8)], [material])
    notes = reflection_notes(scene)
    assert len(notes) == expected
    start = "curved and rough reflections are approximate (1 material; 26 dB within a chrome ball "
    assert all(note.startswith(start) for note in notes)
    without = reflection_notes(scene, probes=0)
    assert len(without) == expected
    start = "reflections show the sky and lamps, not the scene (1 material)"
    assert all(note.startswith(start) for note in without)
    assert not reflection_notes(scene_of([sphere(1.0, 8)], [material], None, MATTE))


def test_planar_mirrors_and_panes_are_drawn():
    chrome = Material(metallic=1.0, roughness=0.0)
    pane = Material(transmission=0.5, roughness=0.1, specular=1.0)
    for material, shown in (
        (chrome, "planar mirrors"),
        (pane, "faces of panes"),
    ):
        block = scene_of([box("box", 0)], [material])
        assert not reflection_notes(block, 6)
        key = "(virtual_cameras.mirrors of a sensor file)"
        most = f"6 {shown}: the 4 largest in the image show the scene, the others"
        assert reflection_notes(block) == [f"{most} a reflection probe {key}"]
        assert reflection_notes(block, probes=0) == [f"{most} sky and lamps {key}"]
        assert reflection_notes(block, 0) == [f"6 {shown}: each shows a reflection probe {key}"]
        (note,) = reflection_notes(block, 0, 0)
        assert note.startswith("reflections show the sky and lamps")
        note, *_ = reflection_notes(scene_of([square(), sphere(1.0, 8)], [material]))
        assert note.startswith("curved and rough reflections are approximate")


def test_more_bodies_than_probes_are_noted():
    balls = [sphere(1.0, 8)] * 3
    places = [pose((3.0 * number, 0.0, 0.0)) for number in range(3)]
    scene = scene_of(balls, [Material(metallic=1.0, roughness=0.0)], places)
    approximate, unreflected, few, within = reflection_notes(scene, probes=2)
    assert within == WITHIN
    assert approximate.startswith("curved and rough reflections are approximate")
    assert few == (
        "3 curved or rough reflective bodies: the 2 most prominent show the scene "
        "(virtual_cameras.reflection_probes of a sensor file)"
    )
    assert unreflected.startswith("reflections show the sky and lamps")
    assert len(reflection_notes(scene)) == 2


CHROME = Material(metallic=1.0, roughness=0.0)
WITHIN = (
    "reflectors within reflections are approximate (25 to 43 dB within mirrors and floors that "
    "show them): --backend rays traces them"
)


def _beside(name, x_m, material, size_m=(1.0, 1.0, 1.0)):
    mesh = box(name, material)
    positions = (mesh.positions * np.array(size_m) + (x_m, 0.0, 0.0)).astype(np.float32)
    return dataclasses.replace(mesh, positions=positions)


@pytest.mark.parametrize(
    ("meshes", "expected"),
    [
        ([_beside("box", 0.0, 0)], False),  # its faces do not see each other
        ([_beside("box", 0.0, 0), _beside("other", 3.0, 0)], True),
        ([_beside("box", 0.0, 0), dataclasses.replace(sphere(0.5, 8), material=0)], True),
        ([_beside("box", 0.0, 0), _beside("pane", 3.0, 1)], False),
        ([_beside("box", 0.0, 0), _beside("matte", 3.0, 2)], False),
        ([square(0.5), square(0.2)], False),  # one plane
    ],
)
def test_reflectors_within_reflections_are_noted(meshes, expected):
    pane = Material(transmission=0.5, roughness=0.1, specular=1.0)
    scene = scene_of(meshes, [CHROME, pane, Material()])
    assert (WITHIN in reflection_notes(scene)) is expected
    assert (WITHIN in reflection_notes(scene, 0, 0)) is False


@pytest.mark.parametrize("thickness_m", [0.0, 0.01])
def test_a_flat_window_is_neither_curved_nor_a_mirror(thickness_m):
    glass = Material(transmission=1.0, roughness=0.0, specular=1.0, thickness_m=thickness_m)
    window = _beside("window", 0.0, 0, (0.01, 2.0, 1.5))
    assert reflection_notes(scene_of([window], [glass])) == []
    three = [_beside("window", 3.0 * number, 0, (0.01, 2.0, 1.5)) for number in range(9)]
    (note,) = reflection_notes(scene_of(three, [glass]))
    assert "faces of panes" in note


def test_frosted_glass_is_opaque():
    pane = Material(transmission=1.0, roughness=0.6, specular=1.0)
    thick = dataclasses.replace(pane, thickness_m=0.1)
    meshes = [sphere(1.0, 8), dataclasses.replace(sphere(1.0, 8), material=1)]
    scene = scene_of(meshes, [pane, thick])
    opaque = "frosted glass is opaque (2 materials): --backend rays shows what is behind panes"
    assert frosted_notes(scene, False) == [opaque]
    assert frosted_notes(scene, True) == ["thick, frosted glass is opaque (1 material)"]
    clear = scene_of([sphere(1.0, 8)], [dataclasses.replace(pane, roughness=0.2)])
    for other in (clear, scene_of(meshes, [pane, thick], None, MATTE)):
        assert not frosted_notes(other, False) + frosted_notes(other, True)


def test_thick_glass_is_approximate_or_opaque():
    glass = Material(transmission=1.0, thickness_m=0.1, roughness=0.1, specular=1.0)
    ball = scene_of([sphere(1.0, 8)], [glass])
    reflections, note = reflection_notes(ball)
    assert reflections.startswith("curved and rough reflections are approximate")
    assert note.startswith("thick glass is approximate (1 material; 35 dB within a ball ")
    reflections, note = reflection_notes(ball, probes=0)
    assert reflections.startswith("reflections show the sky and lamps")
    assert note == "thick glass is opaque (1 material): --backend rays refracts"
    block = scene_of([box("block", 0)], [dataclasses.replace(glass, roughness=0.0)])
    (note,) = reflection_notes(block, mirrors=8)
    assert note.startswith("thick glass is approximate")
    assert not reflection_notes(dataclasses.replace(ball, lighting=MATTE))


@pytest.mark.parametrize(
    ("material", "expected"), [(Material(metallic=1.0, roughness=0.1), 1), (Material(), 0)]
)
def test_dynamic_objects_are_noted_too(material, expected):
    ball = scene_of([sphere(1.0, 8)], [material])
    scene = scene_of([square()])
    moving = dataclasses.replace(
        scene, objects=(DynamicObject("ball", ball, Rest((0.0, 0.0, 0.0))),)
    )
    assert len(reflection_notes(moving)) == expected
