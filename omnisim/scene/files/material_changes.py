"""Changes of materials by the [[materials]] tables of a scene's TOML file."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import numpy as np

from omnisim.core.errors import SceneError, did_you_mean
from omnisim.scene.files.material_keys import MaterialTable
from omnisim.scene.model import AlphaMode, Material, Scene, Texture
from omnisim.scene.planar_mirrors import is_smooth
from omnisim.scene.surface_reflectance import MIN_ROUGHNESS

_WITH_GLOSS = ("roughness", "ior", "specular_color")


def with_materials(scene: Scene, tables: Sequence[MaterialTable], source: Path) -> Scene:
    """Scene with changed materials, also of its dynamic objects.

    Args:
        scene: scene of a mesh file, or a base scene.
        tables: changes, applied in their order.
        source: their file, for messages.

    Raises:
        SceneError: a pattern without a matching material.
    """
    if not tables:
        return scene
    shapes = (scene, *(one.shape for one in scene.objects))
    names = dict.fromkeys(one.name for shape in shapes for one in shape.materials)
    notices = list(scene.notices)
    if scene.lighting.is_matte:
        notices.append(
            f"{source.name}: materials: of shading 'matte', which shows base colors only"
        )
    changes_of: dict[str, dict[str, Any]] = {}
    for number, table in enumerate(tables):
        for pattern in table.names:
            matched = [name for name in names if _matches(name, pattern)]
            if not matched:
                hint = did_you_mean(pattern, names, "the scene has")
                raise SceneError(
                    f"{source}: materials.{number}.names: no material {pattern!r}; {hint}"
                )
            for name in matched:
                changes_of.setdefault(name, {}).update(table.changes)
    changed: dict[int, Material] = {}
    for shape in shapes:
        for material in shape.materials:
            if material.name in changes_of and id(material) not in changed:
                changes = changes_of[material.name]
                changed[id(material)] = _changed(material, changes)
                notices += _without_effect(changed[id(material)], changes, source.name)
    objects = tuple(
        dataclasses.replace(one, shape=_with_changed(one.shape, changed)) for one in scene.objects
    )
    scene = _with_changed(scene, changed)
    return dataclasses.replace(scene, objects=objects, notices=tuple(dict.fromkeys(notices)))


def changes_light(before: Scene, after: Scene) -> bool:
    """True if other materials change the light on static surfaces, and so a bake.

    The roughness and strength of gloss do not, unless it is a mirror: bakes spread what it reflects
    like a matte surface. For mirrors and glass all properties count.
    """
    if len(before.materials) != len(after.materials):  # a slab of glass begins or ends
        return True
    pairs = zip(before.materials, after.materials, strict=True)
    return any(_lit_properties(one) != _lit_properties(other) for one, other in pairs)


def _matches(name: str, pattern: str) -> bool:
    return fnmatchcase(name, pattern.replace("[", "[[]"))


def _changed(material: Material, changes: Mapping[str, Any]) -> Material:
    """Material with other properties; one that begins to transmit light is no longer blended."""
    properties = dict(changes)
    alpha = material.base_color[3]
    if properties.get("transmission") and material.is_blended:
        properties["alpha_mode"], alpha = AlphaMode.OPAQUE, 1.0
    red, green, blue = properties.get("base_color", material.base_color[:3])
    properties["base_color"] = (red, green, blue, alpha)
    return dataclasses.replace(material, **properties)


def _without_effect(material: Material, changes: Mapping[str, Any], source: str) -> list[str]:
    """Notices on changes that a material does not show."""
    where = f"{source}: materials: {material.name!r}"
    if material.unlit:
        others = [key for key in changes if key != "base_color"]
        return [f"{where} is unlit: no effect of {', '.join(others)}"] if others else []
    is_glossy = material.metallic or material.specular or material.transmission
    keys = [] if is_glossy else [key for key in changes if key in _WITH_GLOSS]
    return [f"{where}: no effect of {', '.join(keys)} without specular or metallic"] if keys else []


def _with_changed(scene: Scene, changed: Mapping[int, Material]) -> Scene:
    materials = tuple(changed.get(id(one), one) for one in scene.materials)
    return dataclasses.replace(scene, materials=materials)


def _lit_properties(material: Material) -> tuple[Any, ...]:
    """Plain properties on which light depends; textures and arrays are left out."""
    if not (material.transmission or is_smooth(material, MIN_ROUGHNESS)):
        return material.base_color, material.alpha_mode, material.emissive
    values = (getattr(material, field.name) for field in dataclasses.fields(material))
    return tuple(one for one in values if not isinstance(one, Texture | np.ndarray))
