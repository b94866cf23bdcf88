"""Ray-cast shadows: light of lamps at a surface point. The reference for the shadow maps."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.rays.caster import RayHits, Rays
from omnisim.scene.model import LAMP_NEAR_M, Light, LightKind

# Offset of shadow rays from their surface: a constant, and a share of its distance.
_START_M, _START_SHARE = 1e-4, 1e-5

# Function of rays (n,) from triangles (n,); it returns the shares (n, 1 or 3) of light that arrive.
CastShadow = Callable[[Rays, NDArray[np.int32]], NDArray[np.float32]]


class Shadows(NamedTuple):
    """Shadows on surfaces.

    Attributes:
        hits: (n,) hits to shade.
        cast: function that casts shadow rays.
    """

    hits: RayHits
    cast: CastShadow

    def share(
        self, light: Light, points_m: NDArray[np.float64], lit: NDArray[np.bool_]
    ) -> NDArray[np.float32]:
        """Shares (n, 1 or 3) of a light that reach points (n, 3): 0 where a surface blocks it.

        Args:
            light: light that casts shadows.
            points_m: (n, 3) points of the hits, world.
            lit: (n,) mask of points that the light can reach if unblocked; others need no ray.
        """
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
