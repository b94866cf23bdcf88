"""Light of lamps and sky on surfaces, with ray-cast shadows, and what surfaces reflect of it.

The twin of shaders/scene/lighting.glsl and reflectance.glsl, and the reference for shadow maps.
Source: glTF 2.0, appendix B; KHR_materials_specular, KHR_materials_clearcoat.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from omnisim.core.arrays import AnyFloats, Bools, Floats, Floats32, Indices, Ints32
from omnisim.core.bilinear import sample
from omnisim.rendering.rays.caster import RayHits, WorldRays
from omnisim.rendering.rays.shading.ray_optics import (
    ABOVE,
    TracedGloss,
    clipped_cosines,
    facing_views,
)
from omnisim.scene.model import LAMP_NEAR_M, Light, Lighting, LightKind
from omnisim.scene.surface_reflectance import COAT_F0, environment_table, smith_visibility


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


def with_lamps(total: Floats32, lamps: Sequence[LampLight], normals: Floats32) -> Floats32:
    """Light (n, 3) on white surfaces with unit normals (n, 3), to which lamps add theirs."""
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


# Offset of shadow rays from their surface: a constant, and a share of its distance.
_START_M, _START_SHARE = 1e-4, 1e-5

# Function of rays (n,) from triangles (n,); it returns the shares (n, 1 or 3) of light that arrive.
CastShadow = Callable[[WorldRays, Ints32], Floats32]


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
        rays = WorldRays(origins_m, directions, np.zeros(len(indices)), far_m)
        passed = self.cast(rays, hits.triangles)
        share = np.tile(share, passed.shape[1])
        share[indices] = passed
        return share


# Reflection and emission of surfaces.


class Reflectance(NamedTuple):
    """Reflectance of surfaces (n,) or (n, 3), as in shaders/scene/reflectance.glsl."""

    body: AnyFloats
    dielectric_f0: AnyFloats
    f0: AnyFloats
    dielectric_f90: AnyFloats
    f90: AnyFloats
    roughness: AnyFloats
    coat: AnyFloats
    coat_roughness: AnyFloats
    occlusion: AnyFloats
    emissive: AnyFloats


class SurfaceDirections(NamedTuple):
    """Normals and view directions at visible surfaces."""

    # (n, 3) normal-mapped unit normals of the surface and its clear coat
    normals: AnyFloats
    coat_normals: AnyFloats
    shape_normals: AnyFloats  # (n, 3) unit normals before normal mapping
    views: AnyFloats  # (n, 3) unit directions toward the origins of the rays


class Traced(NamedTuple):
    """Traced reflections of surfaces (n,) and of their clear coats; None: none is traced."""

    gloss: TracedGloss | None
    coat: TracedGloss | None


def reflected_light(
    surface: Reflectance,
    directions: SurfaceDirections,
    lighting: Lighting,
    lamps: Sequence[LampLight],
    surroundings: AnyFloats | None = None,
    traced: Traced | None = None,
    spreads: AnyFloats | None = None,
) -> AnyFloats:
    """Light (n, 3), linear RGB, that surfaces emit and reflect along the views.

    Args:
        surroundings: (n, 3) baked light on white surfaces, minus the light of lamps; None: no baked
            light.
        traced: traced reflections, which replace those of sky and surroundings; None: none.
        spreads: (n,) slopes by which highlights of lamps are wider, see `Arrivals`; None: 0.
    """
    coat = coat_fresnel(surface.coat, directions)
    total = (1.0 - coat)[:, None] * surface.emissive
    total += _environment(surface, directions, coat, lighting, surroundings, traced)
    if spreads is not None:
        surface = surface._replace(
            roughness=_widened(surface.roughness, spreads),
            coat_roughness=_widened(surface.coat_roughness, spreads),
        )
    for lamp in lamps:
        total += _lamp(surface, directions, coat, lamp)
    return total


def _widened(roughness: AnyFloats, spreads: AnyFloats) -> AnyFloats:
    """Roughness (n,) of facets whose slopes are spread; 0 leaves it as it is."""
    wider = np.minimum((roughness**4 + spreads**2) ** 0.25, 1.0)
    return np.where(spreads > 0.0, wider, roughness)


def coat_fresnel(strengths: AnyFloats, directions: SurfaceDirections) -> AnyFloats:
    """Schlick's reflectance (n,) of clear coats with strengths (n,)."""
    grazing = (1.0 - clipped_cosines(directions.coat_normals, directions.views)) ** 5
    return strengths * (COAT_F0 + (1.0 - COAT_F0) * grazing)


def _lamp(
    surface: Reflectance, directions: SurfaceDirections, coat: AnyFloats, lamp: LampLight
) -> AnyFloats:
    toward = np.broadcast_to(lamp.directions, directions.views.shape)
    halfway = toward + directions.views
    halfway = halfway / np.maximum(np.linalg.norm(halfway, axis=1, keepdims=True), 1e-7)
    grazing = (1.0 - np.clip(_dot(directions.views, halfway), 0.0, 1.0)) ** 5
    gloss = _between(surface.f0, surface.f90, grazing)
    light = np.maximum(_dot(directions.normals, toward), 0.0)
    view = clipped_cosines(directions.normals, directions.views)
    gloss *= microfacets(surface.roughness, directions.normals, halfway, light, view)[:, None]
    lost = _between(surface.dielectric_f0, surface.dielectric_f90, grazing).max(axis=1)
    total = (light * (1.0 - coat))[:, None] * (surface.body * (1.0 - lost)[:, None] + gloss)
    light = np.maximum(_dot(directions.coat_normals, toward), 0.0)
    view = clipped_cosines(directions.coat_normals, directions.views)
    facets = microfacets(surface.coat_roughness, directions.coat_normals, halfway, light, view)
    total += (coat * light * facets)[:, None]
    return lamp.levels[:, None] * lamp.color * total


def _environment(
    surface: Reflectance,
    directions: SurfaceDirections,
    coat: AnyFloats,
    lighting: Lighting,
    baked: AnyFloats | None,
    traced: Traced | None,
) -> AnyFloats:
    normals, views = directions.normals, directions.views
    shares = _shares(clipped_cosines(normals, views), surface.roughness)
    lost = _between(surface.dielectric_f0, surface.dielectric_f90, shares[:, 2]).max(axis=1)
    body = surface.body * (1.0 - lost)[:, None]
    gloss = surface.f0 * shares[:, :1] + surface.f90[:, None] * shares[:, 1:2]
    light = ambient_light(lighting, normals.astype(np.float32)) if baked is None else baked
    total = body * light
    reflected = gloss * _radiance(lighting, directions, normals, surface.roughness, baked)
    if traced is not None and traced.gloss is not None:
        reflected[traced.gloss.indices] = traced.gloss.light
    total += reflected
    total *= (1.0 - coat)[:, None]
    if coat.any():
        coated = _shares(clipped_cosines(directions.coat_normals, views), surface.coat_roughness)
        normals, roughness = directions.coat_normals, surface.coat_roughness
        seen = _radiance(lighting, directions, normals, roughness, baked)
        reflected = (coat * coated[:, :2].sum(axis=1))[:, None] * seen
        if traced is not None and traced.coat is not None:
            indices = traced.coat.indices
            reflected[indices] = coat[indices, None] * traced.coat.light
        total += reflected
    return surface.occlusion[:, None] * total


def _radiance(
    lighting: Lighting,
    surface: SurfaceDirections,
    normals: AnyFloats,
    roughness: AnyFloats,
    baked: AnyFloats | None,
) -> AnyFloats:
    """Prefiltered radiance (n, 3) of the environment in the dominant direction of reflection.

    Directions of mapped normals that point into the surface are moved above it. With baked light,
    the environment map is scaled by the share of its light that reaches the surface.
    Source: Lagarde and de Rousiers, "Moving Frostbite to PBR", 2014, listing 22; Lazarov, "Getting
    more physical in Call of Duty: Black Ops II", 2013.
    """
    if baked is not None and lighting.environment is None:
        return baked
    total: AnyFloats = np.tile(np.array(lighting.ambient), (len(normals), 1))
    if lighting.environment is not None:
        is_mapped = (normals != surface.shape_normals).any(axis=1)
        views = np.where(is_mapped[:, None], facing_views(normals, surface.views), surface.views)
        mirrored = 2.0 * _dot(normals, views)[:, None] * normals - views
        alpha = roughness * roughness
        share = ((1.0 - alpha) * (np.sqrt(1.0 - alpha) + alpha))[:, None]
        toward = normals + share * (mirrored - normals)
        toward /= np.linalg.norm(toward, axis=1, keepdims=True)
        below = np.maximum(ABOVE - _dot(toward, surface.shape_normals), 0.0) * is_mapped
        toward += below[:, None] * surface.shape_normals
        toward /= np.linalg.norm(toward, axis=1, keepdims=True)
        total = total + lighting.environment.light(toward, roughness)
    if baked is not None:
        ambient = ambient_light(lighting, normals.astype(np.float32))
        total = total * np.clip(baked / np.maximum(ambient, 1e-4), 0.0, 1.0)
    return total


def _shares(cosines: AnyFloats, roughness: AnyFloats) -> AnyFloats:
    table = environment_table()
    rows, columns = table.shape[:2]
    texels = np.stack((cosines * (columns - 1), roughness * (rows - 1)), axis=-1)
    return np.stack([sample(table[..., channel], texels) for channel in range(3)], axis=-1)


def microfacets(
    roughness: AnyFloats, normals: AnyFloats, halfway: AnyFloats, light: AnyFloats, view: AnyFloats
) -> AnyFloats:
    """GGX distribution times visibility, times pi (n,)."""
    squared = roughness**4
    across, height = np.cross(normals, halfway), _dot(normals, halfway)
    spread = _dot(across, across) + height * height * squared
    facets: AnyFloats = squared / np.maximum(spread * spread, 1e-12)
    return facets * smith_visibility(light, view, squared)


def _between(f0: AnyFloats, f90: AnyFloats, grazing: AnyFloats) -> AnyFloats:
    """Schlick's reflectance (n, 3) between f0 (n, 3) and f90 (n,)."""
    return f0 + (f90[:, None] - f0) * grazing[:, None]


def _dot(one: AnyFloats, other: AnyFloats) -> AnyFloats:
    return np.einsum("nc,nc->n", one, other)
