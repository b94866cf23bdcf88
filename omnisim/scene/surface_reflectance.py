"""Surface reflectance of glTF 2.0: constants, and response to uniform light.

Source: glTF 2.0, appendix B; the split sum: Karis, "Real shading in Unreal Engine 4", 2013.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Floats, Floats32

# Smoother surfaces would act as mirrors, which do not reflect a lamp without extent.
MIN_ROUGHNESS = 0.04
COAT_F0 = 0.04  # clear coat with a refractive index of 1.5
TABLE_SIZE = 64, 32  # numbers of cosines and of roughnesses
_DIRECTIONS = 512


def tinted_reflectance(ior: float, color: tuple[float, float, float]) -> tuple[float, float, float]:
    """Reflectance at normal incidence, linear RGB, before the clamp to 1 and `specular`."""
    reflectance = ((ior - 1.0) / (ior + 1.0)) ** 2
    red, green, blue = (reflectance * channel for channel in color)
    return red, green, blue


def dielectric_f0(
    ior: float, specular: float, color: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Reflectance at normal incidence, linear RGB, of a dielectric in air.

    Source: KHR_materials_specular, implementation.
    """
    red, green, blue = (specular * min(channel, 1.0) for channel in tinted_reflectance(ior, color))
    return red, green, blue


@cache
def environment_table() -> Floats32:
    """Reflectance table for a white environment (roughnesses, cosines, 3).

    The cosine between view and normal runs from 0 to 1 along the columns, the roughness along the
    rows. Gloss reflects first · f0 + second · f90. The body below it receives the fraction
    1 − f0 − third · (f90 − f0) of the light.
    """
    cosines = np.linspace(0.0, 1.0, TABLE_SIZE[0])[None, :, None]
    cosines = np.maximum(cosines, 1e-3)
    roughness = np.maximum(np.linspace(0.0, 1.0, TABLE_SIZE[1]), MIN_ROUGHNESS)[:, None, None]
    view = np.concatenate((np.sqrt(1.0 - cosines**2), 0.0 * cosines, cosines), axis=-1)
    number, second = np.arange(_DIRECTIONS), np.zeros(_DIRECTIONS)  # Hammersley points
    for bit in range(32):
        second += ((number >> bit) & 1) * 0.5 ** (bit + 1)
    first = (number + 0.5) / _DIRECTIONS
    gloss = _gloss(view[:, :, None], roughness, first, second)
    body = np.broadcast_to(_body(view[:, :, None], first, second), gloss.shape[:2])
    return np.concatenate((gloss, body[..., None]), axis=-1).astype(np.float32)


def _gloss(view: Floats, roughness: Floats, first: Floats, second: Floats) -> Floats:
    """Weights (roughnesses, cosines, 2) of f0 and f90, sampled over GGX half vectors."""
    squared = roughness**4
    height = np.sqrt((1.0 - first) / (1.0 + (squared - 1.0) * first))
    side = np.sqrt(1.0 - height**2)
    azimuth = 2.0 * np.pi * second
    half_x, view_x, view_z = side * np.cos(azimuth), view[..., 0], view[..., 2]
    along = np.maximum(view_x * half_x + view_z * height, 0.0)
    light_z = 2.0 * along * height - view_z
    visible = smith_visibility(np.maximum(light_z, 0.0), view_z, squared)
    weight = np.where(light_z > 0.0, 4.0 * visible * light_z * along / height, 0.0)
    fresnel = (1.0 - along) ** 5
    shares = (weight * (1.0 - fresnel)).mean(axis=-1), (weight * fresnel).mean(axis=-1)
    return np.stack(shares, axis=-1)


def _body(view: Floats, first: Floats, second: Floats) -> Floats:
    """Means (1, cosines) of Schlick's term over cosine-weighted light.

    Args:
        view: (..., 3) view directions in the frame of the normal.
        first, second: random numbers in [0, 1) that sample the light.
    """
    height, side, azimuth = np.sqrt(1.0 - first), np.sqrt(first), 2.0 * np.pi * second
    between = view[..., 0] * side * np.cos(azimuth) + view[..., 2] * height
    along = np.sqrt(np.clip(0.5 * (1.0 + between), 0.0, 1.0))
    return ((1.0 - along) ** 5).mean(axis=-1)


def smith_visibility(
    light: NDArray[np.floating], view: NDArray[np.floating], squared: NDArray[np.floating]
) -> NDArray[np.floating]:
    """Height-correlated visibility of microfacets, from two cosines and alpha squared; broadcasts.

    Source: Heitz, 2014, as in glTF 2.0, appendix B.3.2.
    """
    behind = light * np.sqrt(view * view * (1.0 - squared) + squared)
    before = view * np.sqrt(light * light * (1.0 - squared) + squared)
    return 0.5 / np.maximum(behind + before, 1e-7)
