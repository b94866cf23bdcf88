"""Glass by Mitsuba 3: thin panes, closed bodies that absorb light, and frosted glass."""

from __future__ import annotations

import math
from typing import Any

import mitsuba as mi
import numpy as np

from omnisim.scene.model import Material
from omnisim.validation.oracles.mitsuba_scene import rgb

_ANGLES = 64  # at which reflectance is averaged


def glass_bsdf(material: Material) -> dict[str, Any]:
    """BSDF of a material that transmits light, with the same on both of its sides.

    Thick frosted glass reflects as much as a pane on average. It scatters that, and what it
    transmits, by Lambert's law. Mitsuba's lobe of thin frosted panes is narrower than glTF's.
    """
    tint = rgb(tuple(material.transmission * one for one in material.base_color[:3]))
    if material.frosted_transmission and not material.thickness_m:
        return {
            "type": "principledthin",
            "base_color": tint,
            "roughness": material.roughness,
            "eta": material.ior,
            "spec_trans": 1.0,
        }
    if material.frosted_transmission:
        reflected = _mean_reflectance(material.ior)
        color = (1.0 - reflected) * np.array(material.base_color[:3])
        transmitted = material.frosted_transmission * color
        total = color + reflected
        return {
            "type": "principledthin",
            "base_color": rgb(tuple(total.tolist())),
            "roughness": 0.5,  # has little effect on diffuse reflection
            "eta": material.ior,
            "diff_trans": 2.0 * float(transmitted.mean() / total.mean()),
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


def _mean_reflectance(ior: float) -> float:
    """Reflectance of a pane's two interfaces, each by Mitsuba, for Lambertian light."""
    fresnel: Any = mi.fresnel  # of numbers, in the variant that is set
    squares = (np.arange(_ANGLES) + 0.5) / _ANGLES
    once = np.array([fresnel(float(np.sqrt(one)), ior)[0] for one in squares])
    return float(np.mean(2.0 * once / (1.0 + once)))


def _absorption_per_m(material: Material) -> tuple[float, ...]:
    """Absorption, linear RGB, that leaves the attenuation color after its distance."""
    return tuple(
        -math.log(one) / material.attenuation_distance_m for one in material.attenuation_color
    )
