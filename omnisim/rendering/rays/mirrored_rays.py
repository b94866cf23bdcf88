"""Rays after mirrors, from the mirrored origin: ranges along them are those of the whole path."""

from __future__ import annotations

import numpy as np

from omnisim.rendering.rays.caster import RayCaster, RayHits, Rays
from omnisim.rendering.rays.shading.surface_light import SurfaceLight

_MIN_COSINE = 0.02  # a ray that grazes a mirror starts at most 50 steps behind its hit


def mirrored_rays(caster: RayCaster, rays: Rays, hits: RayHits, light: SurfaceLight) -> Rays:
    """Rays (n,) reflected at their hits.

    A plane reflects the origin; a curved mirror reflects like its tangent plane. The first step
    leaves the plane by more than a triangle's rounding, also at grazing incidence.
    """
    normals, directions = light.normals, rays.directions
    along = np.einsum("nc,nc->n", directions, normals)
    directions = directions - 2.0 * along[:, None] * normals
    points_m = rays.origins_m + hits.ranges_m[:, None] * rays.directions
    origins_m = points_m - hits.ranges_m[:, None] * directions
    behind = caster.behind(rays, hits.ranges_m)
    steps_m = (behind.near_m - hits.ranges_m) / np.maximum(np.abs(along), _MIN_COSINE)
    return Rays(origins_m, directions, hits.ranges_m + steps_m, rays.far_m)
