"""Notices on reflective and transparent materials that are drawn approximately."""

from __future__ import annotations

from omnisim.core.short_repr import counted
from omnisim.rendering.camera.quality import DEFAULT_MIRRORS, DEFAULT_PROBES
from omnisim.rendering.reflections.kinds import find_reflectors
from omnisim.scene import Scene
from omnisim.scene.reflection_probes import reflects_scene
from omnisim.scene.scene_surfaces import is_surface_planar, scene_surfaces

# Measured by `omnisim validate --only reflections`, as PSNR of the whole image.
_ACCURACY, _GLASS_ACCURACY = "a chrome ball in a room: 36 dB", "a ball in a room: 41 dB"


def reflection_notes(
    scene: Scene, mirrors: int = DEFAULT_MIRRORS, probes: int = DEFAULT_PROBES
) -> list[str]:
    """Notices on materials that reflect or refract the scene exactly with `--backend rays` only.

    Args:
        scene: scene.
        mirrors: number of planar mirrors, and of panes, that virtual cameras show.
        probes: number of reflection probes that they show.
    """
    if scene.lighting.is_matte:
        return []
    found = find_reflectors(scene)
    surfaces, of_mirrors, of_panes, places = found
    planes = (*of_mirrors, *of_panes) if mirrors else ()
    probed = found.probed(probes)
    unreflected = {
        id(one.material)
        for number, one in surfaces.items()
        if reflects_scene(one.material)
        and number not in probed
        and not is_surface_planar(number, planes)
    }
    notes = []
    curved = {number for number in probed if not is_surface_planar(number, planes)}
    if curved:
        approximate = {id(surfaces[number].material) for number in curved}
        notes.append(
            f"curved and rough reflections are approximate ({counted(len(approximate), 'material')}"
            f"; {_ACCURACY}): --backend rays traces them"
        )
    if unreflected:
        notes.append(
            "reflections show the sky and lamps, not the scene "
            f"({counted(len(unreflected), 'material')}): --backend rays shows it"
        )
    if len(places) > probes > 0:
        notes.append(
            f"{len(places)} curved or rough reflective bodies: the {probes} most prominent show "
            "the scene (virtual_cameras.reflection_probes of a sensor file)"
        )
    most = max(len(of_mirrors), len(of_panes))
    if most > mirrors > 0:
        notes.append(
            f"{most} planar mirrors: the {mirrors} largest in view show the scene "
            "(virtual_cameras.mirrors of a sensor file)"
        )
    glass = {number for number, one in surfaces.items() if one.material.glass_transmission}
    clear = {id(surfaces[number].material) for number in glass & probed}
    opaque = {id(surfaces[number].material) for number in glass - probed}
    if clear:
        notes.append(
            f"thick glass is approximate ({counted(len(clear), 'material')}; {_GLASS_ACCURACY}): "
            "--backend rays refracts"
        )
    if opaque:
        notes.append(
            f"thick glass is opaque ({counted(len(opaque), 'material')}): --backend rays refracts"
        )
    return notes


def frosted_notes(scene: Scene, is_traced: bool) -> list[str]:
    """Notice on frosted glass that is drawn opaque.

    Args:
        scene: scene.
        is_traced: True for the ray back end, which draws frosted panes.
    """
    if scene.lighting.is_matte:
        return []
    surfaces = scene_surfaces(scene, [one.shape for one in scene.objects])
    frosted = {
        id(one.material)
        for one in surfaces.values()
        if one.material.frosted_transmission and (one.material.thickness_m or not is_traced)
    }
    if not frosted:
        return []
    number = counted(len(frosted), "material")
    if is_traced:
        return [f"thick, frosted glass is opaque ({number})"]
    return [f"frosted glass is opaque ({number}): --backend rays shows what is behind panes"]
