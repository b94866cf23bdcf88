"""Kinds of reflections of a scene's instances in the back end `cube`."""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple

from omnisim.rendering.camera.quality import DEFAULT_PROBES
from omnisim.scene.model import Scene
from omnisim.scene.planar_mirrors import (
    MirrorPlane,
    SceneSurface,
    find_mirrors,
    is_clear_pane,
    is_planar_mirror,
    is_surface_planar,
    scene_surfaces,
)
from omnisim.scene.reflection_probes import ProbePlace, find_probes, reflects_scene


class ReflectionKind(StrEnum):
    """Kind of an instance's reflection, see the chapter on reflections in rendering.md."""

    MIRROR = "mirror"  # the scene, from a mirrored viewpoint
    PANE = "pane"  # likewise, and it is transparent
    PROBE = "probe"  # the scene, approximately
    SKY = "sky"  # sky and lamps, not the scene


class Reflectors(NamedTuple):
    """Surfaces of a scene that reflect it, and what they show.

    Attributes:
        surfaces: surfaces of the scene, then those of its dynamic objects, by number.
        mirrors, panes: planes of the planar mirrors and of the panes.
        places: reflection probes, most prominent first.
    """

    surfaces: dict[int, SceneSurface]
    mirrors: tuple[MirrorPlane, ...]
    panes: tuple[MirrorPlane, ...]
    places: tuple[ProbePlace, ...]

    def probed(self, probes: int) -> set[int]:
        """Numbers of the surfaces that reflect the first probes."""
        return {number for place in self.places[:probes] for number in place.surfaces}


def find_reflectors(scene: Scene) -> Reflectors:
    """Find the mirrors, panes and probes of a scene that is not matte."""
    surfaces = scene_surfaces(scene, [one.shape for one in scene.objects])
    mirrors = find_mirrors(surfaces, is_planar_mirror)
    panes = find_mirrors(surfaces, is_clear_pane)
    return Reflectors(surfaces, mirrors, panes, find_probes(surfaces, (*mirrors, *panes)))


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
    found = find_reflectors(scene)
    probed = found.probed(probes)
    planes = (ReflectionKind.MIRROR, found.mirrors), (ReflectionKind.PANE, found.panes)
    kinds: dict[str, set[ReflectionKind]] = {}
    for number, instance in enumerate(scene.instances):
        if not reflects_scene(found.surfaces[number].material):
            continue
        own = kinds.setdefault(instance.name, set())
        own.update(kind for kind, some in planes if any(number in one.parts for one in some))
        if number in probed:
            own.add(ReflectionKind.PROBE)
        elif not is_surface_planar(number, (*found.mirrors, *found.panes)):
            own.add(ReflectionKind.SKY)
    return {
        name: tuple(kind for kind in ReflectionKind if kind in own) for name, own in kinds.items()
    }
