"""Even light, which stands in for the lamps that a file does not have, and its absence."""

from __future__ import annotations

import dataclasses

from omnisim.scene.lighting import DEFAULT_LIGHTING
from omnisim.scene.model import Scene


def without_even_light(scene: Scene) -> Scene:
    """Scene in the light of its emissive surfaces alone, if it has no lamps and they are bright.

    Bright ones are brighter than white: a lamp's tubes, and not a screen.
    """
    lighting = scene.lighting
    is_even = lighting.lights is DEFAULT_LIGHTING.lights and not lighting.is_matte
    shining = any(not one.unlit and max(one.emissive) > 1.0 for one in scene.materials)
    if not (is_even and shining):
        return scene
    dark = dataclasses.replace(lighting, lights=(), ambient=(0.0, 0.0, 0.0))
    return dataclasses.replace(scene, lighting=dark)
