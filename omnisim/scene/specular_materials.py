"""Specular materials: glass and mirrors, where light passes or is reflected in one direction."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

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


def specular_mask(materials: Sequence[Material], is_matte: bool) -> NDArray[np.bool_]:
    """Mask (n,) of specular materials; none is if the scene is shaded as matte."""
    if is_matte:
        return np.zeros(len(materials), dtype=np.bool_)
    known: dict[int, bool] = {}
    for one in materials:
        if id(one) not in known:
            known[id(one)] = is_specular(one)
    return np.array([known[id(one)] for one in materials], dtype=np.bool_)


def has_specular(scene: Scene, others: Iterable[Scene] = ()) -> bool:
    """True if a scene, or one of its dynamic objects, has visible specular surfaces."""
    materials = [
        part.materials[part.meshes[instance.mesh].material]
        for part in (scene, *others)
        for instance in part.instances
    ]
    return bool(specular_mask(materials, scene.lighting.is_matte).any())
