"""Even light is baked, unless bright surfaces take its place."""

import dataclasses

import pytest

from omnisim import load_scene
from omnisim.rendering.baking.settings import emission_notes
from omnisim.scene.light.baked import without_even_light
from omnisim.scene.light.lighting import DEFAULT_LIGHTING
from omnisim.scene.model import Lighting, Material
from tests.scenes import scene_of, square


@pytest.mark.parametrize(
    ("material", "options", "is_left_out"),
    [
        ({"emissive": (20.0, 20.0, 18.0)}, {}, True),
        ({"emissive": (1.0, 0.5, 0.5)}, {}, False),  # a screen
        ({}, {}, False),
        ({"emissive": (20.0, 20.0, 18.0)}, {"is_matte": True}, False),  # it is not seen to shine
    ],
)
def test_bright_surfaces_take_the_place_of_even_light(material, options, is_left_out):
    lighting = dataclasses.replace(DEFAULT_LIGHTING, **options)
    scene = scene_of([square()], [Material(**material)], lighting=lighting)
    found = without_even_light(scene).lighting
    assert (found.lights == () and found.ambient == (0.0, 0.0, 0.0)) is is_left_out
    assert (found is lighting) is not is_left_out


def test_a_background_brighter_than_white_shines_in_its_place():
    sky, shining = (4.0, 4.5, 5.0), [Material(emissive=(9.0, 9.0, 9.0))]
    scene = scene_of([square()], shining, lighting=DEFAULT_LIGHTING, background=sky)
    found = without_even_light(scene).lighting
    assert (found.ambient, found.lights) == (sky, ())
    matte = scene_of([square()], lighting=DEFAULT_LIGHTING, background=sky)
    assert without_even_light(matte) is matte


def test_light_of_another_bright_background_is_stale():
    scenes = [
        scene_of([square()], background=sky)
        for sky in ((4.0,) * 3, (5.0,) * 3, (0.5,) * 3, (1.0,) * 3)
    ]
    bright, brighter, dim, white = (scene.identity.light for scene in scenes)
    assert len({bright, brighter, dim}) == 3
    assert dim == white


def test_lamps_and_ambient_light_of_a_file_stay():
    lighting = Lighting((0.5, 0.5, 0.5), ())
    scene = scene_of([square()], [Material(emissive=(9.0, 9.0, 9.0))], lighting=lighting)
    assert without_even_light(scene) is scene


def test_bright_surfaces_that_light_nothing_are_noted():
    panel, screen = Material(emissive=(4.0, 4.0, 4.0)), Material(emissive=(1.0, 1.0, 1.0))
    lighting = dataclasses.replace(DEFAULT_LIGHTING, is_matte=False)
    note, *others = emission_notes(scene_of([square()] * 2, [panel, screen], lighting=lighting))
    assert note.startswith("1 emissive material brighter than white")
    assert not others
    assert not emission_notes(scene_of([square()], [screen], lighting=lighting))
    baked, plain = load_scene("soccer"), load_scene("soccer", baked="none")
    assert not emission_notes(baked)
    assert (len(baked.lighting.lights), len(plain.lighting.lights)) == (0, 2)
