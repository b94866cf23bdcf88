"""Parameters of sensors that matter in scenes with glass and mirrors, and their notices."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection
from typing import TYPE_CHECKING, Any

from omnisim.core.extras import install_hint, missing_packages
from omnisim.core.short_repr import counted
from omnisim.rendering.shared_scene import BackendName
from omnisim.scene import Scene
from omnisim.scene.planar_mirrors import (
    find_mirrors,
    has_specular,
    is_surface_planar,
    scene_surfaces,
)
from omnisim.scene.surface_kind import SurfaceKind

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

SPECULAR_KEYS = ("specular", "returns", "min_intensity")


def stated_parameters(sensor: DataclassInstance) -> dict[str, Any]:
    """Parameters of a sensor for the header of its files; defaults of `SPECULAR_KEYS` are omitted.

    Files of scenes without glass and mirrors are thus the same as without these keys. The format of
    the file is no parameter of the sensor.
    """
    defaults = {key.name: key.default for key in dataclasses.fields(sensor)}
    return {
        key: value
        for key, value in dataclasses.asdict(sensor).items()
        if key != "file_format" and (key not in SPECULAR_KEYS or value != defaults[key])
    }


def specular_notes(scene: Scene, objects: Collection[Scene], backend: BackendName) -> list[str]:
    """Notices on glass and mirrors that beams and depth cameras are not followed at.

    Args:
        scene: static scene.
        objects: dynamic objects.
        backend: name of the back end.
    """
    if not has_specular(scene, objects):
        return []
    if backend == "cube" and missing_packages("rays"):
        return [f"beams and depths end at glass and mirrors: {install_hint('rays')} follows them"]
    surfaces = {
        number: one
        for number, one in scene_surfaces(scene, objects).items()
        if one.kind & SurfaceKind.SPECULAR
    }
    planes = find_mirrors(surfaces, SurfaceKind.SPECULAR)
    curved = {
        id(one.material)
        for number, one in surfaces.items()
        if not is_surface_planar(number, planes)
    }
    if not curved:
        return []
    return [f"beams return nothing from behind curved mirrors ({counted(len(curved), 'material')})"]
