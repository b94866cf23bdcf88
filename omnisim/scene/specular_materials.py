"""Specular materials: glass and mirrors, where light passes or is reflected in one direction."""

from __future__ import annotations

from collections.abc import Iterable

from omnisim.scene.model import AlphaMode, Material, Scene
from omnisim.scene.planar_mirrors import is_smooth
from omnisim.scene.surface_reflectance import MIN_ROUGHNESS


def is_specular(material: Material) -> bool:
    """True for thin panes and for opaque, smooth gloss, metal or clear coats without normal maps.

    Smooth is a roughness of at most `MIN_ROUGHNESS`, anywhere on the surface.
    """
    has_normal_map = material.normal_map or material.clearcoat_normal_map
    if material.alpha_mode is not AlphaMode.OPAQUE or has_normal_map is not None:
        return False
    return material.pane_transmission > 0.0 or is_smooth(material, MIN_ROUGHNESS)


def has_specular(scene: Scene, others: Iterable[Scene] = ()) -> bool:
    """True if a scene, or one of its dynamic objects, has visible specular surfaces."""
    if scene.lighting.is_matte:
        return False
    return any(
        is_specular(part.materials[part.meshes[instance.mesh].material])
        for part in (scene, *others)
        for instance in part.instances
    )
