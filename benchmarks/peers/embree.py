"""Embree, through embreex: one primary ray per pixel, on one thread."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from benchmarks.embree_rays import EmbreeRays
from benchmarks.peers.hit_colors import HitColors
from benchmarks.peers.peer import CAMERA, ImagePeer, Peer
from omnisim.scene.model import Scene

MAX_LAYERS = 16  # transparent surfaces along a ray
# Distance behind a surface at which a ray continues, as a share of its range: a few float32 ULPs.
_BEYOND = 1e-5


class EmbreeGeometry(Peer):
    """Ray caster that finds only the index of the triangle hit by each valid pixel's ray."""

    name = "Embree, geometry"

    def __init__(self, scene: Scene):
        self._rays = EmbreeRays(scene, CAMERA)
        self.texels = self._rays.count

    def render(self, world_from_rig: NDArray[np.float64]) -> NDArray[np.int32]:
        """Indices (n,) of the triangles hit by the valid pixels' rays; −1: no hit."""
        return self._rays.cast(world_from_rig)


class EmbreeColors(ImagePeer):
    """Image by ray casting, with hits textured and lit in NumPy.

    At holes, glass, and the backs of single-sided surfaces the ray continues.

    Attributes:
        rays: one ray per pixel.
    """

    name = "Embree, color"

    def __init__(self, scene: Scene):
        self.rays = EmbreeRays(scene, CAMERA)
        self.texels = self.rays.count
        self._colors = HitColors(scene)
        self._background = np.array(scene.background, dtype=np.float32)

    def render(self, world_from_rig: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Image (height, width, 3)."""
        origins_m, directions = self.rays.aim(world_from_rig)
        total = np.zeros_like(directions)
        rays = np.arange(len(total))
        share = np.ones((len(rays), 1), dtype=np.float32)
        for _ in range(MAX_LAYERS):
            hits = self.rays.mesh.hits(origins_m, directions)
            hit = np.flatnonzero(hits.triangles >= 0)
            if len(hit) < len(rays):
                missed = np.flatnonzero(hits.triangles < 0)
                total[rays[missed]] += share[missed] * self._background
            rays, share, directions = rays[hit], share[hit], directions[hit]
            ranges_m = hits.ranges_m[hit, None]
            points_m = origins_m[hit] + ranges_m * directions
            colors, opacity = self._colors.of(
                hits.triangles[hit], hits.u[hit], hits.v[hit], points_m, directions
            )
            total[rays] += share * opacity * colors
            share = share * (1.0 - opacity)
            on = np.flatnonzero(share[:, 0] > 0.0)
            if not len(on):
                break
            rays, share, directions = rays[on], share[on], directions[on]
            origins_m = points_m[on] + _BEYOND * (1.0 + ranges_m[on]) * directions
        levels = np.zeros((*self.rays.valid.shape, 3), dtype=np.uint8)
        levels[self.rays.valid] = _levels(total)
        return levels


def _levels(linear: NDArray[np.float32]) -> NDArray[np.uint8]:
    """8-bit sRGB levels of linear RGB (n, 3), computed in float32."""
    values = np.clip(linear, np.float32(0.0), np.float32(1.0))
    high = np.float32(1.055) * np.power(values, np.float32(1.0 / 2.4)) - np.float32(0.055)
    encoded = np.where(values <= np.float32(0.0031308), np.float32(12.92) * values, high)
    return (np.float32(255.0) * encoded + np.float32(0.5)).astype(np.uint8)
