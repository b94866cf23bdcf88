"""Punctual lights."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from omnisim.scene.gltf import schema
from omnisim.scene.model import Light, LightKind

_KINDS = {kind.value: kind for kind in LightKind}


def read_lights(
    document: schema.Document,
    file_from_nodes: dict[int, NDArray[np.float64]],
    world_from_file: NDArray[np.float64],
) -> tuple[Light, ...]:
    """Lights of the scene's nodes, in the world frame.

    Raises:
        SceneError: a node's light is not there.

    Source: KHR_lights_punctual; a light points along the −z of its node.
    """
    lights = []
    for index, node in enumerate(document.nodes):
        if node.light is None or index not in file_from_nodes:
            continue
        entry = schema.lookup(document.lights, node.light, f"nodes[{index}].extensions.light")
        world_from_light = world_from_file @ file_from_nodes[index]
        axis = -world_from_light[:3, 2]
        length = np.linalg.norm(axis)
        if entry.type not in _KINDS or length == 0.0:
            continue
        lights.append(
            Light(
                _KINDS[entry.type],
                entry.color,
                entry.intensity,
                position_m=world_from_light[:3, 3],
                direction=axis / length,
                range_m=entry.range if entry.range and entry.range > 0.0 else math.inf,
                cone_cosines=(
                    math.cos(entry.spot.inner_cone_angle),
                    math.cos(entry.spot.outer_cone_angle),
                ),
            )
        )
    return tuple(lights)
