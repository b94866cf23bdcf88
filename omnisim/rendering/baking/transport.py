"""Rays between patches of a scene, straight or by mirrors and through glass.

At a specular surface a ray takes one way at random, see `omnisim.rendering.baking.specular`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from omnisim.core.arrays import Bools, Floats32, Indices, Ints32
from omnisim.rendering.baking.patches import BACK, FRONT, Patches
from omnisim.rendering.baking.specular import SpecularSurfaces, Way, chosen, onward, random_numbers
from omnisim.rendering.rays.caster import NO_TRIANGLE, EmbreeHits, RayHits, put_rows
from omnisim.rendering.rays.ray_scene import MAX_LAYERS, RayScene
from omnisim.rendering.rays.shading.shading import RayView

SKY, INSIDE = -1, -2  # in place of a patch that is hit
# Offset of rays from their surface: a constant, and a share of the scene's size.
_START_M, _START_SHARE = 1e-4, 1e-6
MAX_SPECULAR = 16  # specular surfaces along a ray; it ends at the next one
_EMISSIVE_SHARE = 0.5  # minimum share of the rays that end on an emissive, specular surface


class PatchHits(NamedTuple):
    """Patches hit by rays."""

    patches: Ints32  # (n,) patch, or `SKY`; `INSIDE`: the ray hit the inside of a solid
    ranges_m: Floats32  # (n,) lengths of the rays
    cosines: Floats32  # (n,) between the rays and the planes' normals
    directions: Floats32  # (n, 3) directions at the hits
    shares: Floats32  # (n, 3) factors of the light, or (n, 1) ones
    is_straight: Bools  # (n,) mask of the rays that no mirror has deflected

    def take(self, indices: Indices) -> PatchHits:
        """The selected hits."""
        return PatchHits._make(values[indices] for values in self)

    def put(self, indices: Indices, hits: PatchHits) -> None:
        """Overwrite the selected hits."""
        put_rows(self, indices, hits)


class Transport:
    """Casts rays at the static surfaces of a scene.

    Attributes:
        start_m: offset of ray origins from a surface.
        center_m: (3,) world, reference point of ray origins.
    """

    def __init__(self, rays: RayScene, specular: SpecularSurfaces, patches: Patches):
        self.center_m = rays.caster.static_center_m
        self._caster, self._shading = rays.caster, rays.shading
        geometry = rays.caster.geometry
        self._surface_of_triangle = geometry.surface_of_triangle
        self._patches, self.specular = patches, specular
        positions_m = geometry.positions_m
        size_m = float(np.ptp(positions_m, axis=0).max()) if len(positions_m) else 0.0
        self.start_m = _START_M + _START_SHARE * size_m
        cutoffs = rays.shading.hit_cutoff[geometry.surface_of_triangle]
        self._has_holes = cutoffs > 0.0
        self._has_any_holes = bool(self._has_holes.any())

    def cast(self, origins_m: Floats32, directions: Floats32) -> PatchHits:
        """Patches hit by rays (n, 3) with unit directions, also by mirrors and through glass."""
        hits = self._hits(origins_m, directions, None)
        found = self._on_patches(hits, directions)
        active = np.flatnonzero(self._continues(hits, found.patches))
        if len(active) == 0:
            return found
        shares = np.ones((len(origins_m), 3), dtype=np.float32)
        found = found._replace(shares=shares, directions=directions.copy())
        hits, aims, origins_m = hits.take(active), directions[active], origins_m[active]
        traveled_m = np.zeros(len(active), dtype=np.float32)
        for number in range(MAX_SPECULAR):
            ways = self.specular.ways(hits, aims)
            diffuse = self._diffuse_shares(found.patches[active])
            way, factors = chosen(ways, diffuse, random_numbers(origins_m, aims, number))
            found.shares[active] *= factors
            going = np.flatnonzero(way != Way.END)
            if len(going) == 0:
                break
            mirrored = way[going] == Way.MIRRORED
            traveled_m = traveled_m[going] + hits.ranges_m[going]
            at_m = origins_m[going] + hits.ranges_m[going, None] * aims[going]
            origins_m, aims = onward(at_m, aims[going], ways.take(going), mirrored, self.start_m)
            active = active[going]
            found.is_straight[active] &= ~mirrored
            hits = self._hits(origins_m, aims, None)
            following = self._on_patches(hits, aims)
            found.put(
                active,
                following._replace(
                    ranges_m=traveled_m + hits.ranges_m,
                    shares=found.shares[active],
                    is_straight=found.is_straight[active],
                ),
            )
            going = np.flatnonzero(self._continues(hits, following.patches))
            active, hits, aims = active[going], hits.take(going), aims[going]
            origins_m, traveled_m = origins_m[going], traveled_m[going]
            if len(active) == 0:
                break
        return found

    def _continues(self, hits: EmbreeHits, patches: Ints32) -> Bools:
        """Mask (n,) of specular hits where rays continue: not inside of opaque solids."""
        if not self.specular.any:
            return np.zeros(len(hits.triangles), dtype=np.bool_)
        going = (hits.triangles != NO_TRIANGLE) & self.specular.of_triangles[hits.triangles]
        going &= (patches != INSIDE) | self.specular.see_through[hits.triangles]
        return going

    def _diffuse_shares(self, patches: Ints32) -> Floats32:
        """Diffuse shares (n,) of patches, and more of emissive ones; 0: no patch."""
        shares: Floats32 = self._patches.albedo[patches].mean(axis=1)
        shining = self._patches.emission[patches].any(axis=1)
        shares = np.where(shining, np.maximum(shares, np.float32(_EMISSIVE_SHARE)), shares)
        shares[patches < 0] = 0.0
        return shares

    def _on_patches(self, hits: EmbreeHits, directions: Floats32) -> PatchHits:
        """Patches at hits of rays (n,)."""
        count = len(directions)
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
        ones, straight = np.ones((count, 1), dtype=np.float32), np.ones(count, dtype=np.bool_)
        return PatchHits(patches, hits.ranges_m, cosines, directions, ones, straight)

    def is_back(self, hits: PatchHits) -> Bools:
        """Mask (n,) of rays that hit the back of a patch."""
        on_patch = hits.patches >= 0
        return on_patch & (self._patches.sides[hits.patches] == BACK)

    def is_frosted(self, hits: PatchHits) -> Bools:
        """Mask (n,) of rays that hit frosted glass, from either side."""
        surfaces = self._patches.surfaces[hits.patches]
        return (hits.patches >= 0) & (self.specular.frosted[surfaces] > 0.0)

    def passing(self, origins_m: Floats32, directions: Floats32, far: Floats32 | None) -> Floats32:
        """Shares (n, 1 or 3) of light that arrives along rays: 0 behind opaque surfaces.

        Args:
            origins_m, directions: (n, 3) rays.
            far: (n,) ends of the rays, in lengths of the direction; None: unlimited.
        """
        hits = self._hits(origins_m, directions, far)
        is_free = hits.triangles == NO_TRIANGLE
        specular = self.specular
        if not specular.any_see_through:
            return is_free[:, None].astype(np.float32)
        shares = np.tile(is_free[:, None].astype(np.float32), 3)
        active = np.flatnonzero(~is_free & specular.see_through[hits.triangles])
        passed = np.ones((len(active), 3), dtype=np.float32)
        hits, aims, origins_m = hits.take(active), directions[active], origins_m[active]
        ends = None if far is None else far[active]
        for _ in range(MAX_SPECULAR):
            if len(active) == 0:
                break
            ways = specular.ways(hits, aims)
            passed = passed * ways.passed
            at_m = origins_m + hits.ranges_m[:, None] * aims
            ends = None if ends is None else ends - hits.ranges_m
            straight = np.zeros(len(active), dtype=np.bool_)
            origins_m, _ = onward(at_m, aims, ways, straight, self.start_m)
            hits = self._hits(origins_m, aims, ends)
            is_free = hits.triangles == NO_TRIANGLE
            shares[active[is_free]] = passed[is_free]
            going = np.flatnonzero(~is_free & specular.see_through[hits.triangles])
            active, passed, hits = active[going], passed[going], hits.take(going)
            origins_m, aims = origins_m[going], aims[going]
            ends = None if ends is None else ends[going]
        return shares

    def _hits(self, origins_m: Floats32, directions: Floats32, far: Floats32 | None) -> EmbreeHits:
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
            hits.put(active, self._caster.static_hits(starts, directions[active], ends))
            hits.ranges_m[active] += traveled[active]
            triangles = hits.triangles[active]
            active = active[(triangles != NO_TRIANGLE) & self._has_holes[triangles]]
        return hits

    def _is_hole(self, hits: EmbreeHits) -> Bools:
        """Mask (n,) of hits in a hole of a masked surface, or on a mostly clear blended one."""
        placed = RayHits(hits.triangles, np.zeros(len(hits.u)), hits.weights, hits.normals)
        colors = self._shading.base_colors(RayView.of(placed))
        cutoffs = self._shading.hit_cutoff[self._surface_of_triangle[hits.triangles]]
        return colors[:, 3] < cutoffs

    def _patch_of(self, triangles: Ints32, u: Floats32, v: Floats32, is_back: Bools) -> Ints32:
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
        return patches.of_place[side, places]
