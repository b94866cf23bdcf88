"""Lights of worlds and links."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from omnisim.scene.formats.omissions import Omissions
from omnisim.scene.formats.xml.element import XmlElement
from omnisim.scene.parts import Light, LightKind

_KINDS = {kind.value: kind for kind in LightKind}
_REFERENCE_M = 5.0  # distance of equal brightness for lights with another falloff
_ATTENUATION = "attenuation of lights is drawn as that of 1/distance², equal at a few meters"


def read_light(
    element: XmlElement, world_from_light: NDArray[np.float64], omissions: Omissions
) -> Light | None:
    """Light in the world; None: switched off or black.

    Intensities are relative: at intensity 1 a white surface appears white.

    Raises:
        SceneError: invalid values.
    """
    kind = _KINDS.get(element.attribute("type") or "point")
    if kind is None:
        raise element.error("type point, directional or spot", element.attribute("type"))
    color = element.color("diffuse") or (1.0, 1.0, 1.0)
    intensity = element.number("intensity", 1.0)
    if not element.flag("light_on", default=True) or not any(color) or intensity <= 0.0:
        return None
    direction = np.array(element.vector("direction", (0.0, 0.0, -1.0)))
    length = float(np.linalg.norm(direction))
    axis = world_from_light[:3, :3] @ (direction / length if length > 1e-9 else (0.0, 0.0, -1.0))
    # Gazebo's point lights cast no shadows, and often sit inside lamp meshes
    casts_shadow = element.flag("cast_shadows") and kind is not LightKind.POINT
    if kind is LightKind.DIRECTIONAL:
        return Light(kind, color, intensity, direction=axis, casts_shadow=casts_shadow)
    range_m = element.positive("attenuation/range", 10.0)
    return Light(
        kind,
        color,
        intensity * _candela(element, range_m, omissions),
        position_m=world_from_light[:3, 3].copy(),
        direction=axis,
        range_m=range_m,
        casts_shadow=casts_shadow,
        cone_cosines=_cone_cosines(element) if kind is LightKind.SPOT else (1.0, 0.0),
    )


def _candela(element: XmlElement, range_m: float, omissions: Omissions) -> float:
    """Luminous intensity, cd, of a light with intensity 1."""
    constant, linear, quadratic = (
        max(element.number(f"attenuation/{key}", default), 0.0)
        for key, default in (("constant", 1.0), ("linear", 1.0), ("quadratic", 0.0))
    )
    if constant == linear == 0.0 and quadratic > 0.0:
        return 1.0 / quadratic
    omissions.count(_ATTENUATION, "light")
    distance = min(0.25 * range_m, _REFERENCE_M)
    falloff = constant + linear * distance + quadratic * distance**2
    return distance**2 / max(falloff, 1e-3)


def _cone_cosines(element: XmlElement) -> tuple[float, float]:
    """Cosines of the inner and outer half-angles; the file states full angles."""
    outer = min(max(element.number("spot/outer_angle", 0.0), 1e-3), math.pi)
    inner = min(max(element.number("spot/inner_angle", 0.0), 0.0), outer)
    return math.cos(0.5 * inner), math.cos(0.5 * outer)
