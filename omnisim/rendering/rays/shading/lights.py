"""Lighting of a scene's surfaces, in NumPy: the twin of shaders/scene/lighting.glsl."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.rays.shading.shadows import Shadows
from omnisim.scene.model import Light, Lighting, LightKind


class LampLight(NamedTuple):
    """Light of one lamp at points.

    Attributes:
        color: (3,) or (n, 3) linear RGB on a surface that faces the lamp, at level 1.
        levels: (n,) factors of the color.
        directions: (n, 3) unit, toward the lamp; or (1, 3), the same for all points.
    """

    color: NDArray[np.float32]
    levels: NDArray[np.float32]
    directions: NDArray[np.float32]

    def take(self, indices: NDArray[np.intp]) -> LampLight:
        """Light at the selected points."""
        color, directions = self.color, self.directions
        return LampLight(
            color if color.ndim == 1 else color[indices],
            self.levels[indices],
            directions if len(directions) == 1 else directions[indices],
        )

    def facing(self, normals: NDArray[np.float32]) -> LampLight:
        """Light on surfaces with unit normals (n, 3) before normal maps: none from behind them."""
        is_facing = np.einsum("nc,nc->n", normals, self.directions) > 0.0
        return self._replace(levels=self.levels * is_facing)


def lamps_at(
    lighting: Lighting,
    points_m: NDArray[np.float64],
    normals: NDArray[np.float32],
    shadows: Shadows,
) -> list[LampLight]:
    """Light of each lamp at points (n, 3) of surfaces with unit normals (n, 3)."""
    lamps = []
    for light in lighting.lights:
        level = light.intensity * lighting.exposure
        color = (np.array(light.color) * level).astype(np.float32)
        if light.kind is LightKind.DIRECTIONAL:
            levels = np.ones(len(points_m), dtype=np.float32)
            directions = -light.direction.astype(np.float32)[None]
        else:
            levels, directions = _punctual(light, points_m)
        if light.casts_shadow:
            facing = np.einsum("nc,nc->n", normals, directions) > 0.0
            share = shadows.share(light, points_m, facing & (levels > 0.0))
            if share.shape[1] == 1:
                levels = levels * share[:, 0]
            else:
                color = color * share
        lamps.append(LampLight(color, levels, directions))
    return lamps


def ambient_light(lighting: Lighting, normals: NDArray[np.float32]) -> NDArray[np.float32]:
    """Environment light (n, 3) on white surfaces with unit normals (n, 3)."""
    total = np.tile(np.array(lighting.ambient, dtype=np.float32), (len(normals), 1))
    if lighting.environment is not None:
        total += lighting.environment.ambient(normals).astype(np.float32)
    return total


def light_on_surfaces(
    lighting: Lighting, lamps: Sequence[LampLight], normals: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Linear RGB light (n, 3) of lamps and environment on white surfaces, by normals (n, 3)."""
    return _with_lamps(ambient_light(lighting, normals), lamps, normals)


def light_of_lamps(lamps: Sequence[LampLight], normals: NDArray[np.float32]) -> NDArray[np.float32]:
    """Linear RGB light (n, 3) of lamps alone on white surfaces with unit normals (n, 3)."""
    return _with_lamps(np.zeros((len(normals), 3), dtype=np.float32), lamps, normals)


def _with_lamps(
    total: NDArray[np.float32], lamps: Sequence[LampLight], normals: NDArray[np.float32]
) -> NDArray[np.float32]:
    for lamp in lamps:
        cosines = np.maximum(np.einsum("nc,nc->n", normals, lamp.directions), np.float32(0.0))
        total += (cosines * lamp.levels)[:, None] * lamp.color
    return total


def _punctual(
    light: Light, points_m: NDArray[np.float64]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Levels (n,) divided by squared distance, within range and cone; directions (n, 3)."""
    away = (points_m - light.position_m).astype(np.float32)
    distance_m = np.maximum(np.sqrt(np.einsum("nc,nc->n", away, away)), np.float32(1e-3))
    away /= distance_m[:, None]
    window = np.clip(1.0 - (distance_m / light.range_m) ** 4, 0.0, 1.0)
    levels: NDArray[np.float32] = (window / distance_m**2).astype(np.float32)
    if light.kind is LightKind.SPOT:
        inner, outer = light.cone_cosines
        along = np.einsum("nc,c->n", away, light.direction.astype(np.float32))
        inside = np.clip((along - outer) / max(inner - outer, 1e-3), 0.0, 1.0)
        levels *= (inside * inside).astype(np.float32)
    return levels, -away
