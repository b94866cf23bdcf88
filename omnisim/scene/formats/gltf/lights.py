"""Punctual lights."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from omnisim.scene.formats.gltf.json_object import JsonObject
from omnisim.scene.model import Light, LightKind

_EXTENSION = "KHR_lights_punctual"
_KINDS = {kind.value: kind for kind in LightKind}


def read_lights(
    root: JsonObject, nodes: list[JsonObject], world_from_nodes: dict[int, NDArray[np.float64]]
) -> tuple[Light, ...]:
    """Lights of the scene's nodes, in the world frame.

    Source: KHR_lights_punctual; a light shines along −z of its node.
    """
    extension = root.extension(_EXTENSION)
    entries = extension.objects("lights") if extension else []
    lights = []
    for index in sorted(world_from_nodes):
        reference = nodes[index].extension(_EXTENSION)
        if reference is None:
            continue
        entry, world_from_light = (
            entries[reference.index("light", entries)],
            world_from_nodes[index],
        )
        kind, axis = _KINDS.get(entry.text("type", "")), -world_from_light[:3, 2]
        length = np.linalg.norm(axis)
        if kind is None or length == 0.0:
            continue
        red, green, blue = entry.numbers("color", 3) or (1.0, 1.0, 1.0)
        range_m, spot = entry.number("range", 0.0), entry.object("spot")
        inner = spot.number("innerConeAngle", 0.0)
        outer = spot.number("outerConeAngle", math.pi / 4.0)
        lights.append(
            Light(
                kind,
                (red, green, blue),
                entry.number("intensity", 1.0),
                position_m=world_from_light[:3, 3],
                direction=axis / length,
                range_m=range_m if range_m > 0.0 else math.inf,
                cone_cosines=(math.cos(inner), math.cos(outer)),
            )
        )
    return tuple(lights)
