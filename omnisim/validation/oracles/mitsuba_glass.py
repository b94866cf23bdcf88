"""Glass by Mitsuba 3: thin panes, closed bodies that absorb light, and frosted glass."""

from __future__ import annotations

import math
from typing import Any

from omnisim.scene.model import Material
from omnisim.validation.oracles.mitsuba_scene import rgb


def glass_bsdf(material: Material) -> dict[str, Any]:
    """BSDF of a material that transmits light, with the same on both of its sides.

    Mitsuba's lobe of transmission through thin frosted glass is narrower than that of glTF.
    """
    tint = rgb(tuple(material.transmission * one for one in material.base_color[:3]))
    if material.frosted_transmission:
        return {
            "type": "principledthin",
            "base_color": tint,
            "roughness": material.roughness,
            "eta": material.ior,
            "spec_trans": 1.0,
        }
    return {
        "type": "dielectric" if material.glass_transmission else "thindielectric",
        "int_ior": material.ior,
        "ext_ior": 1.0,
        "specular_transmittance": tint,
    }


def medium(material: Material, units_per_m: float = 1.0) -> dict[str, Any]:
    """Medium in a body of glass, which absorbs light and scatters none."""
    absorption = tuple(one / units_per_m for one in _absorption_per_m(material))
    most = max(absorption)  # colors are at most 1
    return {
        "type": "homogeneous",
        "albedo": 0.0,
        "scale": most,
        "sigma_t": rgb(tuple(one / most for one in absorption)),
    }


def absorbs(material: Material) -> bool:
    """True for a body of colored glass."""
    return material.glass_transmission > 0.0 and max(_absorption_per_m(material)) > 0.0


def _absorption_per_m(material: Material) -> tuple[float, ...]:
    """Absorption, linear RGB, that leaves the attenuation color after its distance."""
    return tuple(
        -math.log(one) / material.attenuation_distance_m for one in material.attenuation_color
    )
