"""Lights of an exported glTF file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.scene.files.file_axes import world_from_axes
from omnisim.scene.parts import Light, LightKind

_NARROWEST_RAD = 1e-4  # gap between a spot's cones, which glTF requires to differ


def written_lights(
    lights: Sequence[Light],
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Entries of KHR_lights_punctual, and the nodes that reference them."""
    nodes = [
        {
            "name": f"light {index}",
            "matrix": _file_from_light(light).T.ravel().tolist(),
            "extensions": {"KHR_lights_punctual": {"light": index}},
        }
        for index, light in enumerate(lights)
    ]
    return [_entry(light) for light in lights], nodes


def _entry(light: Light) -> dict[str, Any]:
    entry: dict[str, Any] = {
        "type": light.kind.value,
        "color": list(light.color),
        "intensity": light.intensity,
    }
    if light.kind is not LightKind.DIRECTIONAL and math.isfinite(light.range_m):
        entry["range"] = light.range_m
    if light.kind is LightKind.SPOT:
        inner, outer = (math.acos(min(max(one, -1.0), 1.0)) for one in light.cone_cosines)
        outer = min(max(outer, _NARROWEST_RAD), 0.5 * math.pi)
        entry["spot"] = {
            "innerConeAngle": min(max(inner, 0.0), outer - _NARROWEST_RAD),
            "outerConeAngle": outer,
        }
    return entry


def _file_from_light(light: Light) -> NDArray[np.float64]:
    """Pose (4, 4) of a light that shines along its −z, in the y-up file."""
    matrix = np.eye(4)
    if light.kind is not LightKind.POINT:
        matrix[:3, 2] = -light.direction
        matrix[:3, 0] = np.cross(np.eye(3)[np.argmin(np.abs(light.direction))], matrix[:3, 2])
        matrix[:3, 0] /= np.linalg.norm(matrix[:3, 0])
        matrix[:3, 1] = np.cross(matrix[:3, 2], matrix[:3, 0])
    if light.kind is not LightKind.DIRECTIONAL:
        matrix[:3, 3] = light.position_m
    file_from_world: NDArray[np.float64] = world_from_axes("y", 1.0).T
    product: NDArray[np.float64] = file_from_world @ matrix
    return product
