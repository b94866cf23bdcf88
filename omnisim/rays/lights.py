"""Light of a scene on its surfaces, in NumPy: the twin of shaders/scene/lighting.glsl."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.scene.model import Light, Lighting, LightKind


def light_on_surfaces(
    lighting: Lighting, points_m: NDArray[np.float64], normals: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Light on white surfaces, linear RGB (n, 3), at points (n, 3) with unit normals (n, 3)."""
    total = np.tile(np.array(lighting.ambient, dtype=np.float32), (len(normals), 1))
    for light in lighting.lights:
        color = np.array(light.color) * (light.intensity * lighting.exposure)
        if light.kind is LightKind.DIRECTIONAL:
            axis = light.direction.astype(np.float32)
            levels = np.maximum(-np.einsum("nc,c->n", normals, axis), np.float32(0.0))
        else:
            levels = _punctual_levels(light, points_m, normals)
        total += levels[:, None] * color.astype(np.float32)
    return total


def _punctual_levels(
    light: Light, points_m: NDArray[np.float64], normals: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Lambert's cosine over the squared distance, within the range and the cone (n,)."""
    away = (points_m - light.position_m).astype(np.float32)
    distance_m = np.maximum(np.sqrt(np.einsum("nc,nc->n", away, away)), np.float32(1e-3))
    away /= distance_m[:, None]
    cosines = np.maximum(-np.einsum("nc,nc->n", normals, away), np.float32(0.0))
    window = np.clip(1.0 - (distance_m / light.range_m) ** 4, 0.0, 1.0)
    levels: NDArray[np.float32] = (cosines * window / distance_m**2).astype(np.float32)
    if light.kind is LightKind.SPOT:
        inner, outer = light.cone_cosines
        along = np.einsum("nc,c->n", away, light.direction.astype(np.float32))
        inside = np.clip((along - outer) / max(inner - outer, 1e-3), 0.0, 1.0)
        levels *= (inside * inside).astype(np.float32)
    return levels
