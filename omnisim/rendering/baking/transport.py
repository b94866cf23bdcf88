"""Rays between patches of a scene."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.baking.atlas.patches import BACK, FRONT, Patches
from omnisim.rendering.rays.caster import RayHits, Rays
from omnisim.rendering.rays.embree import NO_TRIANGLE, EmbreeHits
from omnisim.rendering.rays.ray_scene import MAX_LAYERS, RayScene

Floats = NDArray[np.float32]
SKY, INSIDE = -1, -2
# Offset of rays from their surface: a constant, and a share of the scene's size.
_START_M, _START_SHARE = 1e-4, 1e-6


class PatchHits(NamedTuple):
    """Patches hit by rays.

    Attributes:
        patches: (n,) patch, or `SKY`; `INSIDE`: the ray hit the inside of a solid.
        ranges_m: (n,) ranges.
        cosines: (n,) between the rays and the planes' normals.
    """

    patches: NDArray[np.int32]
    ranges_m: Floats
    cosines: Floats

    def take(self, indices: NDArray[np.intp]) -> PatchHits:
        """The selected hits."""
        return PatchHits(self.patches[indices], self.ranges_m[indices], self.cosines[indices])


class Transport:
    """Casts rays at the static surfaces of a scene.

    Args:
        rays: ray scene.
        patches: patches of the scene.

    Attributes:
        start_m: offset of ray origins from a surface.
        center_m: (3,) world, reference point of ray origins.
    """

    def __init__(self, rays: RayScene, patches: Patches):
        self.center_m = rays.caster.static_center_m
        self._caster, self._shading = rays.caster, rays.shading
        geometry = rays.caster.geometry
        self._surface_of_triangle = geometry.surface_of_triangle
        self._patches = patches
        positions_m = geometry.positions_m
        size_m = float(np.ptp(positions_m, axis=0).max()) if len(positions_m) else 0.0
        self.start_m = _START_M + _START_SHARE * size_m
        cutoffs = rays.shading.hit_cutoff[geometry.surface_of_triangle]
        self._has_holes = cutoffs > 0.0
        self._has_any_holes = bool(self._has_holes.any())

    def cast(self, origins_m: Floats, directions: Floats) -> PatchHits:
        """Patches hit by rays (n, 3) with unit directions."""
        hits = self._hits(origins_m, directions, None)
        count = len(origins_m)
        is_hit = np.flatnonzero(hits.triangles != NO_TRIANGLE)
        patches = np.full(count, SKY, dtype=np.int32)
        cosines = np.zeros(count, dtype=np.float32)
        triangles, normals = hits.triangles[is_hit], hits.normals[is_hit]
        along = np.einsum("nc,nc->n", normals, directions[is_hit])
        is_back = along > 0.0
        lengths = np.sqrt(np.einsum("nc,nc->n", normals, normals))
        cosines[is_hit] = np.abs(along) / np.maximum(lengths, np.float32(1e-30))
        patches_hit = self._patch_of(triangles, hits.u[is_hit], hits.v[is_hit], is_back)
        patches_hit[is_back & ~self._patches.is_hollow[triangles]] = INSIDE
        patches[is_hit] = patches_hit
        return PatchHits(patches, hits.ranges_m, cosines)

    def is_back(self, hits: PatchHits) -> NDArray[np.bool_]:
        """Mask (n,) of rays that hit the back of a patch."""
        on_patch = hits.patches >= 0
        back: NDArray[np.bool_] = on_patch & (self._patches.sides[hits.patches] == BACK)
        return back

    def is_hidden(
        self, origins_m: Floats, directions: Floats, far: Floats | None
    ) -> NDArray[np.bool_]:
        """Mask (n,) of rays blocked by a surface, hit on either side.

        Args:
            origins_m, directions: (n, 3) rays.
            far: (n,) ends of the rays, in lengths of the direction; None: unlimited.
        """
        hidden: NDArray[np.bool_] = self._hits(origins_m, directions, far).triangles != NO_TRIANGLE
        return hidden

    def _hits(self, origins_m: Floats, directions: Floats, far: Floats | None) -> EmbreeHits:
        """Nearest triangles along rays, ignoring holes of masked surfaces."""
        hits = self._caster.static_hits(origins_m, directions, far)
        if not self._has_any_holes:
            return hits
        active = np.flatnonzero((hits.triangles != NO_TRIANGLE) & self._has_holes[hits.triangles])
        traveled = np.zeros(len(origins_m), dtype=np.float32)
        for _ in range(MAX_LAYERS):
            active = active[self._is_hole(hits.take(active))]
            if len(active) == 0:
                break
            passed_m = hits.ranges_m[active] * np.float32(1.0 + 1e-6)
            traveled[active] = passed_m + np.float32(self.start_m)
            starts = origins_m[active] + traveled[active, None] * directions[active]
            ends = None if far is None else far[active] - traveled[active]
            on = self._caster.static_hits(starts, directions[active], ends)
            hits.put(active, on)
            hits.ranges_m[active] += traveled[active]
            triangles = hits.triangles[active]
            active = active[(triangles != NO_TRIANGLE) & self._has_holes[triangles]]
        return hits

    def _is_hole(self, hits: EmbreeHits) -> NDArray[np.bool_]:
        """Mask (n,) of hits in a hole of a masked surface, or on a mostly clear blended one."""
        weights = np.stack((1.0 - hits.u - hits.v, hits.u, hits.v), axis=1)
        nowhere = np.zeros((len(hits.u), 3))
        ranges_m = np.zeros(len(hits.u))
        placed = RayHits(hits.triangles, ranges_m, weights, hits.normals)
        colors = self._shading.base_colors(Rays(nowhere, nowhere, ranges_m, ranges_m), placed)
        cutoffs = self._shading.hit_cutoff[self._surface_of_triangle[hits.triangles]]
        hole: NDArray[np.bool_] = colors[:, 3] < cutoffs
        return hole

    def _patch_of(
        self,
        triangles: NDArray[np.int32],
        u: Floats,
        v: Floats,
        is_back: NDArray[np.bool_],
    ) -> NDArray[np.int32]:
        patches = self._patches
        width, height = patches.size_px
        corners = patches.corners_px[triangles]
        first = corners[:, 0]
        place_px = (
            first + u[:, None] * (corners[:, 1] - first) + v[:, None] * (corners[:, 2] - first)
        )
        column = place_px[:, 0].astype(np.intp)
        places = place_px[:, 1].astype(np.intp) * width + column
        surfaces = self._surface_of_triangle[triangles]
        without = ~patches.has_rect[surfaces]
        places[without] = width * height + surfaces[without]
        side = np.where(is_back, BACK, FRONT)
        result: NDArray[np.int32] = patches.of_place[side, places]
        return result
