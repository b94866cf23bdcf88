"""Reflections of a scene's instances in the back end `cube`, and notices on glass and mirrors."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from enum import StrEnum

import numpy as np

from omnisim.core.arrays import triangle_crosses
from omnisim.core.extras import install_hint, missing_packages
from omnisim.core.short_repr import counted
from omnisim.rendering.camera.quality import DEFAULT_MIRRORS, DEFAULT_PROBES
from omnisim.rendering.shared_scene import BackendName
from omnisim.scene.model import Scene
from omnisim.scene.planar_mirrors import (
    MirrorPlane,
    SceneSurface,
    find_mirrors,
    is_surface_planar,
    scene_surfaces,
)
from omnisim.scene.reflection_probes import find_reflectors
from omnisim.scene.surface_kind import SurfaceKind


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

    An instance has several if its parts or faces differ. Of mirrors and panes, a camera draws those
    that fill most of its view.

    Args:
        probes: number of reflection probes of the camera.
    """
    surfaces = scene_surfaces(scene, [moving.shape for moving in scene.objects])
    found = find_reflectors(surfaces)
    probed = found.probed(probes)
    planes = (ReflectionKind.MIRROR, found.mirrors), (ReflectionKind.PANE, found.panes)
    kinds: dict[str, set[ReflectionKind]] = {}
    for number, instance in enumerate(scene.instances):
        if not surfaces[number].kind & SurfaceKind.REFLECTING:
            continue
        own = kinds.setdefault(instance.name, set())
        own.update(kind for kind, some in planes if any(number in mirror.parts for mirror in some))
        if number in probed:
            own.add(ReflectionKind.PROBE)
        elif not is_surface_planar(number, (*found.mirrors, *found.panes)):
            own.add(ReflectionKind.SKY)
    return {
        name: tuple(kind for kind in ReflectionKind if kind in own) for name, own in kinds.items()
    }


# Notices on reflective and transparent materials that are drawn approximately.

# PSNR against rays within the objects of the rooms of `omnisim validate --only reflections`.
_ACCURACY = "26 dB within a chrome ball in a room"
_GLASS_ACCURACY = "35 dB within a ball in a room"
_WITHIN_ACCURACY = "25 to 43 dB within mirrors and floors that show them"
_FLAT_SHARE = 0.8  # of the area, from which a body with a rim is flat


def reflection_notes(
    scene: Scene, mirrors: int = DEFAULT_MIRRORS, probes: int = DEFAULT_PROBES
) -> list[str]:
    """Notices on materials that reflect or refract the scene exactly with `--backend rays` only.

    Args:
        mirrors: number of planar mirrors, and of panes, that virtual cameras show.
        probes: number of reflection probes that they show.
    """
    surfaces = scene_surfaces(scene, [moving.shape for moving in scene.objects])
    found = find_reflectors(surfaces)
    planes = (*found.mirrors, *found.panes)
    probed = found.probed(probes)
    shown = {number for place in found.drawn(mirrors, probes) for number in place.surfaces}
    flat = {
        number
        for number in frozenset().union(*(plane.parts for plane in planes))
        if _flat_share(surfaces[number], number, planes) >= _FLAT_SHARE
    }
    unreflected = {
        number
        for number, surface in surfaces.items()
        if surface.kind & SurfaceKind.REFLECTING
        and number not in (shown | flat if mirrors else shown)
    }
    glass = {number for number, surface in surfaces.items() if surface.kind & SurfaceKind.GLASS}
    notes = []
    if curved := probed - flat:
        notes.append(
            f"curved and rough reflections are approximate ({_materials(surfaces, curved)}"
            f"; {_ACCURACY}): --backend rays traces them"
        )
    if unreflected:
        notes.append(
            "reflections show the sky and lamps, not the scene "
            f"({_materials(surfaces, unreflected)}): --backend rays shows it"
        )
    bodies = [not place.surfaces <= flat for place in found.places]
    if probes > 0 and any(bodies[probes:]):
        notes.append(
            f"{sum(bodies)} curved or rough reflective bodies: the {probes} most prominent show "
            "the scene (virtual_cameras.reflection_probes of a sensor file)"
        )
    for some, name in ((found.mirrors, "planar mirrors"), (found.panes, "faces of panes")):
        if len(some) > mirrors and (mirrors or shown):
            most = f"the {mirrors} largest in the image show the scene, the others "
            others = "a reflection probe" if shown else "sky and lamps"
            notes.append(
                f"{len(some)} {name}: {most if mirrors else 'each shows '}{others} "
                "(virtual_cameras.mirrors of a sensor file)"
            )
    if probes and found.repeats(mirrors, probes):
        notes.append(
            f"reflectors within reflections are approximate ({_WITHIN_ACCURACY}): "
            "--backend rays traces them"
        )
    if clear := glass & probed:
        notes.append(
            f"thick glass is approximate ({_materials(surfaces, clear)}; {_GLASS_ACCURACY}): "
            "--backend rays refracts"
        )
    if opaque := glass - probed:
        notes.append(
            f"thick glass is opaque ({_materials(surfaces, opaque)}): --backend rays refracts"
        )
    return notes


def _materials(surfaces: Mapping[int, SceneSurface], numbers: Iterable[int]) -> str:
    """Number of the different materials of some surfaces, in words."""
    return counted(len({id(surfaces[number].material) for number in numbers}), "material")


def _flat_share(surface: SceneSurface, number: int, planes: Sequence[MirrorPlane]) -> float:
    """Share of a surface's area that mirrors and panes hold."""
    corners = surface.mesh.positions[surface.mesh.triangles] @ surface.object_from_mesh[:3, :3].T
    areas = np.linalg.norm(triangle_crosses(corners), axis=1)
    held = np.any([plane.parts[number] for plane in planes if number in plane.parts], axis=0)
    return float(areas[held].sum() / max(areas.sum(), 1e-30))


def frosted_notes(scene: Scene, is_traced: bool) -> list[str]:
    """Notice on frosted glass that is drawn opaque; `is_traced`: panes are not, by rays."""
    surfaces = scene_surfaces(scene, [moving.shape for moving in scene.objects])
    opaque = SurfaceKind.FROSTED_GLASS if is_traced else SurfaceKind.FROSTED
    frosted = [number for number, surface in surfaces.items() if surface.kind & opaque]
    if not frosted:
        return []
    number = _materials(surfaces, frosted)
    if is_traced:
        return [f"thick, frosted glass is opaque ({number})"]
    return [f"frosted glass is opaque ({number}): --backend rays shows what is behind panes"]


def specular_notes(scene: Scene, objects: Collection[Scene], backend: BackendName) -> list[str]:
    """Notices on glass and mirrors beyond which beams and depth cameras are not followed.

    Args:
        scene: static scene.
        objects: dynamic objects.
        backend: name of the back end.
    """
    surfaces = scene_surfaces(scene, objects)
    specular = {
        key: surface for key, surface in surfaces.items() if surface.kind & SurfaceKind.SPECULAR
    }
    if specular and backend == "cube" and missing_packages("rays"):
        return [f"beams and depths end at glass and mirrors: {install_hint('rays')} follows them"]
    planes = find_mirrors(specular, SurfaceKind.SPECULAR)
    curved = [number for number in specular if not is_surface_planar(number, planes)]
    if not curved:
        return []
    return [f"beams return nothing from behind curved mirrors ({_materials(surfaces, curved)})"]
