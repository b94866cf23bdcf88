"""Light of lamps and sky on surfaces, with ray-cast shadows, in NumPy.

The twin of shaders/scene/lighting.glsl, and the reference for the shadow maps.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from omnisim.core.arrays import Bools, Floats, Floats32, Indices, Ints32
from omnisim.rendering.rays.caster import RayHits, Rays
from omnisim.scene.model import LAMP_NEAR_M, Light, Lighting, LightKind


class LampLight(NamedTuple):
    """Light of one lamp at points."""

    color: Floats32  # (3,) or (n, 3) linear RGB on a surface that faces the lamp, at level 1
    levels: Floats32  # (n,) factors of the color
    directions: Floats32  # (n, 3) unit, toward the lamp; or (1, 3), the same for all points

    def take(self, indices: Indices) -> LampLight:
        """Light at the selected points."""
        color, directions = self.color, self.directions
        return LampLight(
            color if color.ndim == 1 else color[indices],
            self.levels[indices],
            directions if len(directions) == 1 else directions[indices],
        )

    def facing(self, normals: Floats32) -> LampLight:
        """Light on surfaces with unit normals (n, 3) before normal maps: none from behind them."""
        is_facing = np.einsum("nc,nc->n", normals, self.directions) > 0.0
        return self._replace(levels=self.levels * is_facing)


def lamps_at(
    lighting: Lighting, points_m: Floats, normals: Floats32, shadows: Shadows
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


def ambient_light(lighting: Lighting, normals: Floats32) -> Floats32:
    """Environment light (n, 3) on white surfaces with unit normals (n, 3)."""
    total = np.tile(np.array(lighting.ambient, dtype=np.float32), (len(normals), 1))
    if lighting.environment is not None:
        total += lighting.environment.ambient(normals).astype(np.float32)
    return total


def light_on_surfaces(
    lighting: Lighting, lamps: Sequence[LampLight], normals: Floats32
) -> Floats32:
    """Linear RGB light (n, 3) of lamps and environment on white surfaces, by normals (n, 3)."""
    return _with_lamps(ambient_light(lighting, normals), lamps, normals)


def light_of_lamps(lamps: Sequence[LampLight], normals: Floats32) -> Floats32:
    """Linear RGB light (n, 3) of lamps alone on white surfaces with unit normals (n, 3)."""
    return _with_lamps(np.zeros((len(normals), 3), dtype=np.float32), lamps, normals)


def _with_lamps(total: Floats32, lamps: Sequence[LampLight], normals: Floats32) -> Floats32:
    for lamp in lamps:
        cosines = np.maximum(np.einsum("nc,nc->n", normals, lamp.directions), np.float32(0.0))
        total += (cosines * lamp.levels)[:, None] * lamp.color
    return total


def _punctual(light: Light, points_m: Floats) -> tuple[Floats32, Floats32]:
    """Levels (n,) divided by squared distance, within range and cone; directions (n, 3)."""
    away = (points_m - light.position_m).astype(np.float32)
    distance_m = np.maximum(np.sqrt(np.einsum("nc,nc->n", away, away)), np.float32(1e-3))
    away /= distance_m[:, None]
    window = np.clip(1.0 - (distance_m / light.range_m) ** 4, 0.0, 1.0)
    levels: Floats32 = (window / distance_m**2).astype(np.float32)
    if light.kind is LightKind.SPOT:
        inner, outer = light.cone_cosines
        along = np.einsum("nc,c->n", away, light.direction.astype(np.float32))
        inside = np.clip((along - outer) / max(inner - outer, 1e-3), 0.0, 1.0)
        levels *= (inside * inside).astype(np.float32)
    return levels, -away


# Ray-cast shadows: light of lamps at a surface point. The reference for the shadow maps.


# Offset of shadow rays from their surface: a constant, and a share of its distance.
_START_M, _START_SHARE = 1e-4, 1e-5

# Function of rays (n,) from triangles (n,); it returns the shares (n, 1 or 3) of light that arrive.
CastShadow = Callable[[Rays, Ints32], Floats32]


class Shadows(NamedTuple):
    """Shadows on surfaces."""

    hits: RayHits  # (n,) hits to shade
    cast: CastShadow  # function that casts shadow rays

    def share(self, light: Light, points_m: Floats, lit: Bools) -> Floats32:
        """Shares (n, 1 or 3) of a light at points (n, 3); 0: blocked, or not `lit` (n,)."""
        share = lit.astype(np.float32)[:, None]
        indices = np.flatnonzero(lit)
        if not len(indices):
            return share
        hits = self.hits.take(indices)
        planes = hits.planes.astype(np.float64)
        planes /= np.maximum(np.linalg.norm(planes, axis=1), 1e-30)[:, None]
        starts_m = _START_M + _START_SHARE * hits.ranges_m
        origins_m = points_m[indices] + starts_m[:, None] * planes
        if light.kind is LightKind.DIRECTIONAL:
            directions = np.tile(-light.direction, (len(indices), 1))
            far_m = np.full(len(indices), np.inf)
        else:
            directions = light.position_m - origins_m
            lengths_m = np.linalg.norm(directions, axis=1)
            directions /= np.maximum(lengths_m, 1e-9)[:, None]
            far_m = lengths_m - LAMP_NEAR_M
        rays = Rays(origins_m, directions, np.zeros(len(indices)), far_m)
        passed = self.cast(rays, hits.triangles)
        share = np.tile(share, passed.shape[1])
        share[indices] = passed
        return share
