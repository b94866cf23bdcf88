"""Notices on emissive surfaces that must be baked to light a scene."""

from __future__ import annotations

from omnisim.core.short_repr import counted
from omnisim.scene.light.emissive_light import is_bright
from omnisim.scene.model import Scene


def emission_notes(scene: Scene) -> list[str]:
    """Notices on bright emissive materials of a scene without baked light."""
    shapes = (scene, *(one.shape for one in scene.objects))
    shining = sum(is_bright(material) for shape in shapes for material in shape.materials)
    if not shining or scene.lighting.is_matte or scene.lighting.baked is not None:
        return []
    return [
        f"{counted(shining, 'emissive material')} brighter than white: "
        "lights other surfaces only once baked, see omnisim bake"
    ]
