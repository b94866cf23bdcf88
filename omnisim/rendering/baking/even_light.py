"""Emissive surfaces that light a scene: even light makes way for them, and they must be baked."""

from __future__ import annotations

import dataclasses

from omnisim.core.short_repr import counted
from omnisim.scene.light.lighting import DEFAULT_LIGHTING, background_light
from omnisim.scene.model import Material, Scene


def without_even_light(scene: Scene) -> Scene:
    """Scene lit by its emissive surfaces alone, if it has no lamps and they are bright.

    Bright means brighter than white: a lamp's tubes, but not a screen. A background brighter than
    white counts too: it is the sky outside.
    """
    lighting = scene.lighting
    is_even = lighting.lights is DEFAULT_LIGHTING.lights and not lighting.is_matte
    if not (is_even and any(map(_shines, scene.materials))):
        return scene
    sky = background_light(scene.background)
    shone = dataclasses.replace(lighting, lights=(), ambient=sky)
    return dataclasses.replace(scene, lighting=shone)


def emission_notes(scene: Scene) -> list[str]:
    """Notices on bright emissive materials of a scene without baked light."""
    shapes = (scene, *(one.shape for one in scene.objects))
    shining = sum(_shines(material) for shape in shapes for material in shape.materials)
    if not shining or scene.lighting.is_matte or scene.lighting.baked is not None:
        return []
    return [
        f"{counted(shining, 'emissive material')} brighter than white: "
        "lights other surfaces only once baked, see omnisim bake"
    ]


def _shines(material: Material) -> bool:
    return not material.unlit and max(material.emissive) > 1.0
