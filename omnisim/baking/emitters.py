"""Light of emissive surfaces: rays to points on them, weighed against those that meet them.

Source of the weights: Veach and Guibas, "Optimally combining sampling techniques for Monte Carlo
rendering", 1995, the balance heuristic.
"""

from __future__ import annotations

import numpy as np

from omnisim.baking.patches import Patches
from omnisim.baking.points import Points
from omnisim.baking.sampling import Floats, turned
from omnisim.baking.transport import PatchHits, Transport

_LUMINANCE = np.array((0.2126, 0.7152, 0.0722), dtype=np.float32)
_SHORTEST_M2 = 1e-8


class Emitters:
    """Emissive patches, chosen in proportion to their power.

    Args:
        patches: of the scene.
        points: of all their entries in `Patches.of_sample`.
        aimed: rays to emitters from each place.
        gathered: rays from it by the cosine.
    """

    def __init__(self, patches: Patches, points: Points, aimed: int, gathered: int):
        power = (patches.emission @ _LUMINANCE) * patches.areas_m2
        power[np.diff(patches.first) == 0] = 0.0
        total = float(power.sum(dtype=np.float64))
        self.aimed = aimed if total > 0.0 else 0
        self._gathered = gathered
        self._emission = patches.emission
        mine = np.flatnonzero(power > 0.0)
        # side after side of what shines, so that rays are shared among them evenly
        triangles = patches.samples.triangles[patches.of_sample[patches.first[mine]]]
        self._mine = mine[np.lexsort((mine, triangles, patches.sides[mine]))]
        share = power[self._mine].astype(np.float64) / max(total, 1e-300)
        self._ends = np.cumsum(share)
        density = np.zeros(patches.count)
        density[self._mine] = share / np.maximum(patches.areas_m2[self._mine], 1e-12)
        self._density = density.astype(np.float32)  # for each square metre
        self._first, self._counts = patches.first, np.diff(patches.first)
        self._points = points

    def light(self, transport: Transport, at: Points, points: Floats, shifts: Floats) -> Floats:
        """Light (n, 3) on white surfaces, by rays to emitters.

        Args:
            transport: through the scene.
            at: (n,) places.
            points: (k, 2) of the unit square, one for each ray of these places.
            shifts: (n, 2) of the places.
        """
        count = len(at.origins_m)
        total = np.zeros((count, 3), dtype=np.float32)
        if not self.aimed:
            return total
        chosen, rays = turned(points, shifts), len(points)
        picked = np.searchsorted(self._ends, chosen[..., 0].ravel() * self._ends[-1], side="right")
        patches = self._mine[np.minimum(picked, len(self._mine) - 1)]
        within = (chosen[..., 1].ravel() * self._counts[patches]).astype(np.intp)
        entries = self._first[patches] + np.minimum(within, self._counts[patches] - 1)
        origins = np.repeat(at.origins_m, rays, axis=0)
        away = self._points.origins_m[entries] - origins
        squared = np.maximum(np.einsum("nc,nc->n", away, away), np.float32(_SHORTEST_M2))
        away /= np.sqrt(squared)[:, None]
        cosines = np.einsum("nc,nc->n", np.repeat(at.normals, rays, axis=0), away)
        above = np.einsum("nc,nc->n", np.repeat(at.planes, rays, axis=0), away)
        theirs = -np.einsum("nc,nc->n", self._points.planes[entries], away)
        some = np.flatnonzero((cosines > 0.0) & (theirs > 0.0) & (above > 0.0))
        far = np.sqrt(squared[some]) * np.float32(1.0 - 1e-4)
        some = some[~transport.is_hidden(origins[some], away[some], far)]
        if not len(some):
            return total
        density = self._density[patches[some]] * squared[some] / theirs[some]
        weights = cosines[some] / np.pi
        weights /= self.aimed * density + self._gathered * weights
        light = self._emission[patches[some]] * weights[:, None]
        for channel in range(3):
            total[:, channel] = np.bincount(
                some // rays, weights=light[:, channel], minlength=count
            )
        return total

    def seen(self, hits: PatchHits, cosines: Floats) -> Floats:
        """Emission (n, 3) of patches that gathering rays end on, less what `light` has of it.

        Args:
            hits: (n,) on patches.
            cosines: (n,) of the rays and the normals that they come from.
        """
        emission = self._emission[hits.patches]
        shining = np.flatnonzero(self._density[hits.patches])
        if self.aimed and len(shining):
            density = self._density[hits.patches[shining]] * hits.ranges_m[shining] ** 2
            density /= np.maximum(hits.cosines[shining], np.float32(1e-6))
            mine = self._gathered * cosines[shining] / np.pi
            emission[shining] *= (mine / (mine + self.aimed * density))[:, None]
        return emission
