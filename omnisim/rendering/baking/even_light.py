"""Even light of files without lamps, and its removal for baking."""

from __future__ import annotations

import dataclasses

from omnisim.scene.light.lighting import DEFAULT_LIGHTING, background_light
from omnisim.scene.model import Scene


def without_even_light(scene: Scene) -> Scene:
    """Scene lit by its emissive surfaces alone, if it has no lamps and they are bright.

    Bright means brighter than white: a lamp's tubes, but not a screen. A background brighter than
    white counts too: it is the sky outside.
    """
    lighting = scene.lighting
    is_even = lighting.lights is DEFAULT_LIGHTING.lights and not lighting.is_matte
    shining = any(not one.unlit and max(one.emissive) > 1.0 for one in scene.materials)
    if not (is_even and shining):
        return scene
    sky = background_light(scene.background)
    shone = dataclasses.replace(lighting, lights=(), ambient=sky)
    return dataclasses.replace(scene, lighting=shone)
