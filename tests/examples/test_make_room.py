"""The example's room is a scene to look at: furnished, textured and lit by its lamp."""

import runpy
from pathlib import Path

import numpy as np

from omnisim.scene import load_scene
from omnisim.scene.model import LightKind
from omnisim.scene.space.floor import floor_height_m
from omnisim.scene.space.start_pose import find_start

PATH = Path(__file__).resolve().parents[2] / "examples" / "make_room.py"


def test_the_room_is_textured_and_lit(tmp_path):
    target = tmp_path / "room.glb"
    runpy.run_path(str(PATH))["main"](str(target))
    scene = load_scene(target)  # a notice would be an error
    assert scene.notices == ()
    (lamp,) = scene.lighting.lights
    assert lamp.kind is LightKind.POINT
    assert lamp.casts_shadow
    np.testing.assert_allclose(lamp.position_m, (0.0, 0.0, 2.1), atol=1e-9)
    names = {instance.name for instance in scene.instances}
    assert {"walls", "floor", "ceiling", "crate", "ball", "pillar"} <= names
    textures = [material.texture for material in scene.materials]
    assert sum(texture is not None and np.ptp(texture.pixels) > 30 for texture in textures) >= 8
    start = find_start(scene.meshes, scene.instances)
    np.testing.assert_allclose(start.position_m, (0.0, 0.0, 1.0), atol=0.01)
    assert abs(floor_height_m(scene, (-1.5, -1.0)) or 0.0) < 0.01
