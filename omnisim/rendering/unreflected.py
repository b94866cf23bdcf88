"""Notices on reflective and transparent materials that are drawn approximately."""

from __future__ import annotations

from omnisim.core.short_repr import counted
from omnisim.rendering.camera.quality import DEFAULT_MIRRORS
from omnisim.scene import Scene
from omnisim.scene.model import Material
from omnisim.scene.planar_mirrors import (
    find_mirrors,
    is_clear_pane,
    is_planar_mirror,
    is_smooth,
)
from omnisim.scene.scene_surfaces import is_surface_planar, scene_surfaces
from omnisim.scene.surface_reflectance import MAX_TRACED_ROUGHNESS


def reflection_notes(scene: Scene, mirrors: int = DEFAULT_MIRRORS) -> list[str]:
    """Notices on materials that reflect or refract the scene with `--backend rays` only.

    Args:
        scene: scene.
        mirrors: number of planar mirrors, and of panes, that virtual cameras show.
    """
    if scene.lighting.is_matte:
        return []
    surfaces = scene_surfaces(scene, [one.shape for one in scene.objects])
    of_mirrors = find_mirrors(surfaces, is_planar_mirror)
    of_panes = find_mirrors(surfaces, is_clear_pane)
    planes = (*of_mirrors, *of_panes) if mirrors else ()
    unreflected = {
        id(one.material)
        for number, one in surfaces.items()
        if reflects_scene(one.material) and not is_surface_planar(number, planes)
    }
    notes = []
    if unreflected:
        notes.append(
            "reflections show the sky and lamps, not the scene "
            f"({counted(len(unreflected), 'material')}): --backend rays shows it"
        )
    most = max(len(of_mirrors), len(of_panes))
    if most > mirrors > 0:
        notes.append(
            f"{most} planar mirrors: the {mirrors} largest in view show the scene "
            "(virtual_cameras.mirrors of a sensor file)"
        )
    thick = {id(one.material) for one in surfaces.values() if one.material.glass_transmission}
    if thick:
        notes.append(
            f"thick glass is opaque ({counted(len(thick), 'material')}): --backend rays refracts"
        )
    return notes


def frosted_notes(scene: Scene) -> list[str]:
    """Notice on frosted glass, which transmits light in bakes only."""
    if scene.lighting.is_matte:
        return []
    surfaces = scene_surfaces(scene, [one.shape for one in scene.objects])
    frosted = {id(one.material) for one in surfaces.values() if one.material.frosted_transmission}
    if not frosted:
        return []
    return [
        f"frosted glass is opaque ({counted(len(frosted), 'material')}): bakes light through it"
    ]


def reflects_scene(material: Material) -> bool:
    """True if the ray back end traces reflections: glass, smooth metal, gloss or clear coat."""
    transmission = material.pane_transmission + material.glass_transmission
    return transmission > 0.0 or is_smooth(material, MAX_TRACED_ROUGHNESS)
