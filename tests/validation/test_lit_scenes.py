"""Lit scenes of the validation have their own light alone, whatever the built-in ones have."""

import pytest

from omnisim.scene import load_scene
from omnisim.scene.model import LightKind
from omnisim.validation.checks.lit_scenes import FOLDER

LIT = {
    "soccer": ([LightKind.POINT, LightKind.POINT], 0.001),
    "courtyard": ([LightKind.POINT, LightKind.DIRECTIONAL], 1e-5),
}


@pytest.mark.parametrize("name", LIT)
def test_light_is_that_of_the_lamps(name):
    scene = load_scene(FOLDER / f"{name}.toml")
    kinds, exposure = LIT[name]
    lighting = scene.lighting
    assert [one.kind for one in lighting.lights] == kinds
    assert all(one.casts_shadow for one in lighting.lights)
    assert (lighting.ambient, lighting.exposure) == ((0.0, 0.0, 0.0), exposure)
    assert (lighting.environment, lighting.baked, lighting.fog) == (None, None, None)
    assert scene.background == (0.0, 0.0, 0.0)
    assert not scene.objects
