"""Materials whose reflections of the scene the back end of cubes leaves out."""

import numpy as np
import pytest

from omnisim.rendering.unreflected import reflection_note, reflects_scene
from omnisim.scene.model import Lighting, Material, Texture
from tests.scenes import scene_of, square


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
    assert reflects_scene(material) is expected
    scene = scene_of([square()], [material])
    note = reflection_note(scene)
    if expected:
        assert note.startswith("reflections show the sky and lamps, not the scene (1 material)")
    else:
        assert note is None
    assert (
        reflection_note(
            scene_of([square()], [material], None, Lighting((1, 1, 1), (), is_matte=True))
        )
        is None
    )
