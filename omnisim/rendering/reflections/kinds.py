"""Kinds of reflections of a scene's instances in the back end `cube`."""

from __future__ import annotations

from enum import StrEnum

from omnisim.rendering.camera.quality import DEFAULT_PROBES
from omnisim.scene.model import Scene
from omnisim.scene.planar_mirrors import find_mirrors, is_clear_pane, is_planar_mirror
from omnisim.scene.reflection_probes import find_probes, reflects_scene
from omnisim.scene.scene_surfaces import is_surface_planar, scene_surfaces


class ReflectionKind(StrEnum):
    """Kind of an instance's reflection, see the chapter on reflections in rendering.md."""

    MIRROR = "mirror"  # the scene, from a mirrored viewpoint
    PANE = "pane"  # likewise, and it is transparent
    PROBE = "probe"  # the scene, approximately
    SKY = "sky"  # sky and lamps, not the scene


def reflection_kinds(
    scene: Scene, probes: int = DEFAULT_PROBES
) -> dict[str, tuple[ReflectionKind, ...]]:
    """Kinds of reflections by the names of the static instances that reflect.

    An instance has several if its parts or faces differ. Of mirrors and panes, a camera draws the
    largest in view.

    Args:
        scene: scene.
        probes: number of reflection probes of the camera.
    """
    if scene.lighting.is_matte:
        return {}
    surfaces = scene_surfaces(scene, [one.shape for one in scene.objects])
    mirrors = find_mirrors(surfaces, is_planar_mirror)
    panes = find_mirrors(surfaces, is_clear_pane)
    places = find_probes(surfaces, (*mirrors, *panes))
    probed = {number for place in places[:probes] for number in place.surfaces}
    kinds: dict[str, set[ReflectionKind]] = {}
    for number, instance in enumerate(scene.instances):
        if not reflects_scene(surfaces[number].material):
            continue
        found = {
            kind
            for kind, planes in ((ReflectionKind.MIRROR, mirrors), (ReflectionKind.PANE, panes))
            if any(number in plane.parts for plane in planes)
        }
        if number in probed:
            found.add(ReflectionKind.PROBE)
        elif not is_surface_planar(number, (*mirrors, *panes)):
            found.add(ReflectionKind.SKY)
        kinds.setdefault(instance.name, set()).update(found)
    return {
        name: tuple(kind for kind in ReflectionKind if kind in found)
        for name, found in kinds.items()
    }
