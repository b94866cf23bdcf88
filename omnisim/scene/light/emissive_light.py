"""Scenes lit by emissive surfaces: even light, the substitute for lamps, makes way for them."""

from __future__ import annotations

import dataclasses

from omnisim.scene.light.lighting import DEFAULT_LIGHTING, background_light
from omnisim.scene.model import Material, Scene


def without_even_light(scene: Scene) -> Scene:
    """Scene lit by its emissive surfaces alone, if it has no lamps and they are bright.

    A background brighter than white counts too: it is the sky outside.
    """
    lighting = scene.lighting
    is_even = lighting.lights is DEFAULT_LIGHTING.lights and not lighting.is_matte
    if not (is_even and any(map(is_bright, scene.materials))):
        return scene
    sky = background_light(scene.background)
    shone = dataclasses.replace(lighting, lights=(), ambient=sky)
    return dataclasses.replace(scene, lighting=shone)


def is_bright(material: Material) -> bool:
    """True for emission brighter than white: a lamp's tubes, but not a screen."""
    return not material.unlit and max(material.emissive) > 1.0
