"""Light of a scene's lamps on patches, with their shadows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.baking.points import Points
from omnisim.rendering.baking.transport import Transport
from omnisim.rendering.rays.caster import RayHits
from omnisim.rendering.rays.shading.lights import LampLight, lamps_at
from omnisim.rendering.rays.shading.shadows import Shadows
from omnisim.scene.model import LAMP_NEAR_M, Light, Lighting, LightKind

Floats = NDArray[np.float32]


def lamps_on(
    lighting: Lighting, transport: Transport, origins_m: Floats, at: Points | None = None
) -> list[LampLight]:
    """Light of each lamp, straight or through glass, at points (n, 3).

    Args:
        lighting: lighting with the lamps.
        transport: ray casting in the scene.
        origins_m: (n, 3) points, relative to the transport's center.
        at: surface points, which receive no light from behind; None: points in free space.
    """
    points_m = origins_m + transport.center_m
    lamps = lamps_at(lighting.without_shadows(), points_m, origins_m, _no_shadows())
    return [
        _shadowed(light, lamp, transport, origins_m, at) if light.casts_shadow else lamp
        for light, lamp in zip(lighting.lights, lamps, strict=True)
    ]


def lamp_light(lamps: list[LampLight], points: Points) -> Floats:
    """Light (n, 3) of lamps on white surfaces at points."""
    total = np.zeros_like(points.origins_m)
    for lamp in lamps:
        cosines = np.maximum(np.einsum("nc,nc->n", points.normals, _all(lamp, total)), 0.0)
        total += (cosines * lamp.levels)[:, None] * lamp.color
    return total


def _all(lamp: LampLight, points: Floats) -> Floats:
    return np.broadcast_to(lamp.directions, points.shape)


def _shadowed(
    light: Light,
    lamp: LampLight,
    transport: Transport,
    origins_m: Floats,
    at: Points | None,
) -> LampLight:
    directions, levels = _all(lamp, origins_m), lamp.levels.copy()
    for sides in () if at is None else (at.normals, at.planes):
        levels[np.einsum("nc,nc->n", sides, directions) <= 0.0] = 0.0
    some = np.flatnonzero(levels > 0.0)
    if len(some):
        aims = np.ascontiguousarray(directions[some])
        far = None
        if light.kind is not LightKind.DIRECTIONAL:
            away_m = light.position_m - transport.center_m - origins_m[some]
            far_m = np.linalg.norm(away_m, axis=1) - LAMP_NEAR_M
            far = np.maximum(far_m, 0.0).astype(np.float32)
        passed = transport.passing(origins_m[some], aims, far)
        if passed.shape[1] == 1:
            levels[some] *= passed[:, 0]
        else:
            color = np.tile(lamp.color, (len(levels), 1))
            color[some] *= passed
            lamp = lamp._replace(color=color)
    return lamp._replace(levels=levels)


def _no_shadows() -> Shadows:
    """Shadows for lamps that cast none."""
    none = np.zeros((0, 3))
    hits = RayHits(
        np.zeros(0, np.int32), np.zeros(0), none.astype(np.float32), none.astype(np.float32)
    )
    return Shadows(hits, lambda rays, triangles: np.ones((0, 1), np.float32))
