"""Light of a scene: from the tables of its TOML file, or of emissive surfaces instead of lamps."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from omnisim.scene.files.scene_file import SceneFile
from omnisim.scene.light.light_tables import LampTable, SunTable
from omnisim.scene.light.lighting import (
    DEFAULT_LIGHTING,
    FILL_AMBIENT,
    background_light,
    expose,
    is_even,
)
from omnisim.scene.light.sky import sun_illuminance_lx, sun_position
from omnisim.scene.model import Material, Scene
from omnisim.scene.parts import Fog, Light, Lighting, LightKind

# Contrast that remains at the visibility distance.
# Source: WMO, "Guide to Instruments and Methods of Observation", 2018, section 9.1.
_VISIBLE_CONTRAST = 0.05


def lit_scene(scene: Scene, settings: SceneFile) -> Scene:
    """Scene with the light and fog of its TOML file.

    Lamps added to a base scene with a sky use the base scene's exposure.
    """
    table, lighting = settings.light, scene.lighting
    lamps = [_lamp(one) for one in settings.lamps]
    if settings.sun is not None:
        lamps += _sun(settings.sun)
    if lamps:
        lighting = _with_lamps(scene, tuple(lamps))
        if settings.extends is not None and scene.lighting.environment is not None:
            lighting = replace(lighting, exposure=scene.lighting.exposure)
    elif settings.sun is not None and is_even(lighting):
        lighting = replace(lighting, lights=(), ambient=FILL_AMBIENT)  # the sun is down
    if table.shadows is not None and not is_even(lighting):
        lighting = lighting.with_shadows(table.shadows)
    if table.ambient is not None:
        if not any(table.ambient) and is_even(lighting):
            lighting = replace(lighting, lights=())
        lighting = replace(lighting, ambient=table.ambient)
    if table.exposure is not None:
        if settings.extends is not None and lighting.environment is not None:
            lighting = replace(
                lighting,
                environment=lighting.environment.scaled(table.exposure / lighting.exposure),
            )
        lighting = replace(lighting, exposure=table.exposure)
    if (fog := settings.fog) is not None:
        others = {}
        if fog.visibility_m is not None:
            others["attenuation_per_m"] = (-math.log(_VISIBLE_CONTRAST) / fog.visibility_m,) * 3
        lighting = replace(lighting, fog=fog.build(Fog, **others))
    return scene if lighting is scene.lighting else replace(scene, lighting=lighting)


def _with_lamps(scene: Scene, lamps: tuple[Light, ...]) -> Lighting:
    """Lighting of a scene with additional lamps, which replace even light."""
    before = scene.lighting
    was_even = is_even(before)
    own = () if was_even else before.lights
    lit = scene if scene.instances else scene.at_start()  # if it has only dynamic objects
    exposed = expose((*own, *lamps), lit.meshes, lit.instances)
    ambient = exposed.ambient if was_even else before.ambient
    return replace(before, lights=exposed.lights, exposure=exposed.exposure, ambient=ambient)


def _lamp(table: LampTable) -> Light:
    others: dict[str, Any] = {"casts_shadow": table.shadows}
    if table.position_m is not None:
        others["position_m"] = np.array(table.position_m)
    if table.direction is not None:
        others["direction"] = np.array(table.direction) / np.linalg.norm(table.direction)
    if table.kind is LightKind.SPOT:
        inner = math.radians(table.inner_deg or 0.0)
        outer = math.radians(45.0 if table.outer_deg is None else table.outer_deg)
        others["cone_cosines"] = (math.cos(inner), math.cos(outer))
    return table.build(Light, **others)


def _sun(table: SunTable) -> list[Light]:
    """Sun as a list of one light, empty if it is below the horizon."""
    position = sun_position(table.time, table.latitude_deg, table.longitude_deg)
    if position.elevation_deg <= 0.0:
        return []
    level = table.illuminance_lx or sun_illuminance_lx(position.elevation_deg)
    return [
        table.build(
            Light,
            kind=LightKind.DIRECTIONAL,
            intensity=level,
            direction=position.direction(table.north_deg),
            casts_shadow=table.shadows,
        )
    ]


def without_even_light(scene: Scene) -> Scene:
    """Scene lit by its emissive surfaces alone, if it has no lamps and they are bright.

    A background brighter than white counts too: it is the sky outside.
    """
    lighting = scene.lighting
    is_even = lighting.lights is DEFAULT_LIGHTING.lights and not lighting.is_matte
    if not (is_even and any(map(is_bright, scene.materials))):
        return scene
    sky = background_light(scene.background)
    shone = replace(lighting, lights=(), ambient=sky)
    return replace(scene, lighting=shone)


def is_bright(material: Material) -> bool:
    """True for emission brighter than white: a lamp's tubes, but not a screen."""
    return not material.unlit and max(material.emissive) > 1.0
